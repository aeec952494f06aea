"""Everything that touches the disk: images in and out, tables, reports, the output folder.

Only this package writes files, and only this package knows OpenImageIO. Whatever it writes
appears whole or not at all (`atomic`); a run's files appear together (`folder`).
"""
