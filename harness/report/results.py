"""The result of `screwgauge.run`: a comparison that can be written, drawn and shown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from screwgauge.reference.errors import DescriptionError, UnknownNameError, check_choice
from screwgauge.reference.outputs import check_free, save_file
from screwgauge.report.blocks import Block, as_kind
from screwgauge.report.figures.saved import Figure
from screwgauge.report.html import fragment
from screwgauge.report.pages import run as run_page
from screwgauge.report.record import values_table
from screwgauge.report.write import Shown
from screwgauge.study.comparison import Comparison


class Results(Shown, Comparison):
    """A comparison with its report, which notebooks display."""

    __slots__ = ()

    def write(self, out: str | Path, *, samples: bool = False, pdf: bool = False, force: bool = False) -> Path:
        """Write the tables and the summary into a folder, then the report and its plots; replace an earlier report.

        Args:
            out: Folder, created if needed; it stays unchanged if the data cannot be written.
            samples: Also write every sample of every engine, as Parquet.
            pdf: Also print the page as PDF, which needs Chromium or Chrome.
            force: Replace existing files, whatever their origin.

        Raises:
            OutputError: The folder is not writable, or contains different files with these names; or pyarrow is
                missing.
            ReportError: The data were written, but the report could not be made.
        """
        return self._write(out, samples=samples, pdf=pdf, force=force)

    def to_csv(
        self,
        path: str | Path,
        *,
        engine: str | None = None,
        quantities: Iterable[str] | None = None,
        force: bool = False,
    ) -> list[Path]:
        """Write times and values exactly as CSV with units in the header; a scene can use such a file as its table.

        Args:
            path: A file ``NAME.csv``, or a folder for a file ``ENGINE.csv`` of each engine.
            engine: Name of the engine whose values are written; by default, the first engine for a file, and all
                engines for a folder.
            quantities: Names; by default positions, actuator forces, reactions, observables, and quantities that are
                computed only on request, such as ``resistance``. Headers end with ``not unique`` if redundant
                constraints leave a component undetermined; its values are then one choice among many.
            force: Replace existing files, whatever their origin.

        Returns:
            The paths of the written files.

        Raises:
            OutputError: A file cannot be written, or an existing file was changed or written by something else.
            UnknownNameError: The engine or a quantity is unknown.
        """
        known = {name for solution in self.solutions.values() for name in solution.values}
        names = check_choice("engine", [engine] if engine else [*self.solutions], self.solutions)
        wanted = None if quantities is None else check_choice("quantity", quantities, known)
        files = csv_files(Path(path), names)
        for file in files.values():
            check_free(file, force=force)
        for name, file in files.items():
            table = values_table(self.solutions[name], self.times, wanted, self.not_unique)
            save_file(file, table.to_csv(index=False, lineterminator="\n"), force=force)
        return [*files.values()]

    def plot(self) -> Figures:
        """Return the figures of the report."""
        return Figures(as_kind(Figure, picture) for picture in run_page.pictures(self))

    def frame(self, quantity: str) -> pd.DataFrame:
        """Build a table of a quantity over time from all engines: index t [s], columns engine and component.

        Raises:
            UnknownNameError: No engine computed the quantity; the error lists the available quantities.
        """
        if not (having := self._solutions_with(quantity)):
            raise UnknownNameError("quantity", quantity, {*chain(*(s.values for s in self.solutions.values()))})
        values = {solution.engine: solution.values[quantity] for solution in having}
        columns = [(engine, component) for engine, each in values.items() for component in each.components]
        return pd.DataFrame(
            np.hstack([each.array for each in values.values()]),
            index=pd.Index(self.times, name="t"),
            columns=pd.MultiIndex.from_tuples(columns, names=["engine", "component"]),
        )

    def figure(self, name: str) -> Figures:
        """Return the figures that show a quantity (e.g. ``actuator_force``) or have a given name (e.g. ``mechanism``).

        ``.save("f.pdf", width="8.5cm", font="Times", size=8)`` writes only the curves, for a paper, as PDF, SVG or PNG
        (``dpi=600``), see `Figure.save`.

        Raises:
            UnknownNameError: No figure matches; the error lists the available names.
        """
        every = self.plot()
        pictures = [picture for picture in every if name in (picture.of, picture.name, picture.name.partition("-")[2])]
        if not pictures:
            raise UnknownNameError("figure", name, [picture.name for picture in every])
        return Figures(pictures)

    def _report(self) -> Any:
        return run_page

    def _page(self) -> Iterable[Block]:
        return run_page.report(self, self.plot())

    def _screen(self) -> Iterable[Block]:
        return run_page.terminal(self, judge=False)


def csv_files(path: Path, engines: Sequence[str]) -> dict[str, Path]:
    """Return engine -> file for its values: `path` itself, or ``path/ENGINE.csv``."""
    return {engines[0]: path} if path.suffix == ".csv" else {name: path / f"{name}.csv" for name in engines}


class Figures(list[Figure]):
    """List of `Figure`, which notebooks display; a list with one figure can be saved like the figure."""

    def __repr__(self) -> str:
        return "\n".join(picture.title for picture in self)

    def _repr_html_(self) -> str:
        return fragment(self)

    def save(self, path: str | Path, **style: Any) -> Path:
        """Write the only figure; `style` contains further arguments of `Figure.save`.

        Raises:
            DescriptionError: The list does not contain exactly one figure.
        """
        if len(self) != 1:
            names = ", ".join(f"figure({picture.name!r})" for picture in self)
            raise DescriptionError(f"cannot save {len(self)} figures in one file", str(path), f"choose one of {names}")
        return self[0].save(path, **style)
