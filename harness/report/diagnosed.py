"""What `screwgauge.diagnose` returns: a diagnosis that can be written and shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

from screwgauge.diagnosis import diagnose as study
from screwgauge.diagnosis.deadline import LIMIT
from screwgauge.diagnosis.diagnose import Diagnosis
from screwgauge.diagnosis.model import Loops, Read, Weighed, in_process
from screwgauge.reference.errors import OutputError
from screwgauge.report.html import fragment, page
from screwgauge.report.lock import locked
from screwgauge.report.pages.diagnosis import PAGE
from screwgauge.report.terminal import screenful
from screwgauge.report.write import save_page


class DiagnosisReport(Diagnosis):
    """A diagnosis with its report; a notebook shows it."""

    __slots__ = ()

    def write(self, out: str | Path, *, force: bool = False) -> Path:
        """Writes ``diagnosis.json`` into a folder, then report and plots; those of the report before are replaced.

        Args:
            out: Folder, made if need be; if the numbers cannot be written, it is as it was before.
            force: Files in the way are replaced, whoever wrote them.

        Raises:
            OutputError: The folder cannot be written or has other files of these names.
            ReportError: The numbers are there, the report could not be made.
        """
        if out == "":
            raise OutputError("is empty, which would be the current folder", "out", "name a folder")
        with locked(Path(out)):
            return PAGE.write(self, Path(out), force=force)

    def to_html(self, path: str | Path | None = None) -> str | Path:
        """The report as one page that opens offline.

        Args:
            path: File that it is written to.

        Returns:
            The path, or the text of the page without one.

        Raises:
            OutputError: The file cannot be written.
        """
        text = page(PAGE.blocks(self, PAGE.draw(self)))
        return text if path is None else save_page(Path(path), text)

    def __repr__(self) -> str:
        return screenful(PAGE.terminal(self))

    def _repr_html_(self) -> str:
        return fragment(PAGE.terminal(self))


def diagnose(
    a: str | Path | Weighed,
    b: str | Path | Weighed,
    *,
    map: str | Path | Mapping[str, str] | None = None,
    seed: int = 0,
    matrix: bool = False,
    loops: Loops = None,
    limit: float = LIMIT,
    load: Read = in_process,
) -> DiagnosisReport:
    """Compares two models of a machine, says why they differ, and proves it.

    Joints are paired by name, else by the tree and its geometry. What the files say is compared number by number,
    motion and dynamics at random states of the machine. The differences are then put into B one after the other until
    its torques are those of A: what explains how much of the torque difference, and that nothing else is left.

    Args:
        a, b: URDF, MJCF or description (a built-in name or a path), or ``FILE@LIBRARY`` as ``pinocchio``, ``mujoco`` or
            ``yourdfpy`` reads it.
        map: Joints and bodies of A with those of B where names and geometry do not tell, or a TOML file of them.
        seed: Of the random states.
        matrix: Read both files by all libraries, too.
        loops: What closes the loops of URDFs where that does not lie beside them, ``robot.yaml`` or ``.loops.toml``:
            one file for both, or one for each side, None for what lies beside it.
        limit: Time after which nothing further is begun, what is not done being named in `left_out`; 3600 [s].
        load: Reads a file; by default in this process, where a library that crashes takes it along.

    Returns:
        The diagnosis, true if the two are the same. `verdict` is a sentence or two, `differences` and `causes` have a
        `sentence` each, and `write_fix` writes B as it would have to be.

    Raises:
        ScrewgaugeError: A file, or the map, cannot be read; or loops of neither model close.
    """
    found = study.diagnose(a, b, map=map, seed=seed, matrix=matrix, loops=loops, limit=limit, load=load)
    return DiagnosisReport(**{item.name: getattr(found, item.name) for item in fields(found)})
