"""The commands of the program `vcam`: parse the command line, call a package, print."""
