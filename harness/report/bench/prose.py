"""What the report of a bench says in words."""

from __future__ import annotations

READ = """\
Every point is one contestant with one setting. **Error** is scaled: the largest difference from the reference over
all components and compared times, over the largest magnitude of that unit. **Run time** is that of the whole call
over the samples that it delivers. Contestants do not all do the same work, and the column `covers` says what each
does: filled marks start from the independent coordinates and close the loops themselves, hollow ones are given the
true joint motion (forward dynamics also the true forces). Compare run times within one kind."""

LEAVING = """\
Quantities are computed only when they are asked for. Each row is one solution of the whole trajectory with less in
it, its run time as a share of everything, and the largest difference of the numbers that remain (over the largest
magnitude of their unit). Without gravity or load only the motion is compared: forces are meant to change. Contacts
are forces, too: where the drawn shapes touch, they enter `mj_inverse`. Models are loaded outside the clock."""

PROTOCOL = """\
- Errors first, times after: errors come from a pass of their own ({samples} compared times), in which no time counts.
- Models are loaded, arrays allocated and true motions read before the clock starts; each contestant has been called
  once by then. A call below 50 ms is made once more right before it is measured.
- All contestants are measured in turn, {rounds} rounds (two if a call lasts half a second, one from five seconds on),
  so that what slows the machine for a while slows all alike. The garbage collector waits meanwhile.
- `bench.csv` has the shortest of the rounds, since disturbances only add; `timings.csv` also the median.
- The clock is `perf_counter_ns`; the row `floor` is an empty loop over the samples under the same clock.
- {threads}
- After {budget} s nothing further begins; what is missing then is marked `cut short`.
- A contestant that raises or returns what is not a number is a row with its reason."""

ONE_THREAD = (
    "BLAS and OpenMP have one thread each, set before numpy is imported: at these matrix sizes more threads cost time, "
    "and how many there are would depend on the machine."
)
MORE_THREADS = (
    "**The number of threads was not fixed**: numpy had been imported before. `screwgauge bench` on the command line "
    "fixes it to one."
)
LIMITS = (
    "Run times are of this machine, this Python and this load; the order of magnitude travels, the digits do not.",
    "Contestants in Python loops carry the loop; a C++ program around the same library would not.",
    "Errors are those at the compared times, on this motion.",
    "Forward dynamics is compared in the accelerations of the tree's joints only; cut joints have no coordinate there.",
    "The scaled error of accelerations is large for forward dynamics on nearly static motions: the forces of a "
    "load of 1 kN have to cancel down to accelerations of 0.1.",
)
