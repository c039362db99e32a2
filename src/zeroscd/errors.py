"""The exceptions that a user of zeroscd can cause.

The tree::

    ZeroscdError            anything below; the command line turns it into one `error:` line
    |-- ImageError          a photo is missing, unreadable, damaged or too large
    |-- SettingsError       an unknown preset or setting, or a value outside its range
    |-- WeightsError        model weights are absent, damaged or not what their name says
    |-- DatasetError        a data set folder is not laid out as expected
    |-- OutputError         a result could not be written

What science expects to fail (two photos that cannot be aligned) is not here: that is a value,
:class:`zeroscd.NotAligned`.
"""


class ZeroscdError(Exception):
    """Something a user can put right; the message says what, where and how, in one line."""


class ImageError(ZeroscdError):
    """A photo is missing, unreadable, damaged or too large."""


class SettingsError(ZeroscdError):
    """An unknown preset or setting, or a value outside its range."""


class WeightsError(ZeroscdError):
    """Model weights are absent, damaged or not what their name says."""


class DatasetError(ZeroscdError):
    """A data set folder is not laid out as expected."""


class OutputError(ZeroscdError):
    """A result could not be written."""
