# SPDX-License-Identifier: GPL-3.0-or-later
"""The one family of exceptions that callers are meant to catch."""


def one_line(text: str) -> str:
    """The text as it can be shown: breaks, control characters and what is not Unicode are escaped as in Python."""
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)


class FMQMError(Exception):
    """Something given cannot be measured; the text names it and says what is wanted.

    One line, whatever the names in it hold.
    """

    def __str__(self) -> str:
        return one_line(super().__str__())


class SettingsError(FMQMError):
    """A setting has a value that the metric does not accept."""


class MeshError(FMQMError):
    """A mesh, material or image cannot be measured."""


class ImageMissingError(MeshError):
    """A base-color image is missing or broken."""


class ImageSizeError(MeshError):
    """An image promises more than may be decoded."""


class FileError(FMQMError):
    """A file cannot be read or written."""


class OutsideError(FileError):
    """A stranger's file names another that lies where it has no business."""


class OutputError(FileError):
    """An output cannot be written, which is no pair's fault: the run stops, and the pair is not taken as done."""
