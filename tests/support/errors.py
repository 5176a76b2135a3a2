"""Errors that tests expect."""

from screwgauge.reference.errors import (
    ClosureError,
    DescriptionError,
    JointLimitError,
    LoaderError,
    ModelFileError,
    OutputError,
    ReportError,
    SingularPoseError,
    UnknownNameError,
    printable,
    quote,
)
