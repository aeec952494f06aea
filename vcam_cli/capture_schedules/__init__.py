"""The study of capture schedules: what a file may say, the methods compared, tables and plots."""
