"""YAML files of any model: trees with places, quantities, part files, overrides, messages, schemas.

Nothing here knows what a file is about; `file_format.FileFormat` is what a package says of its own.
"""
