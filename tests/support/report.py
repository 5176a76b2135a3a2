"""Reports: blocks, pages, figures and folders."""

from screwgauge.report.figures import chart
from screwgauge.report.figures.chart import CROSS, SHAPES, looks_by_camp
from screwgauge.report.figures.drawings import default_figures
from screwgauge.report.figures.renderer import RENDERER, DrawingError, losses
from screwgauge.report.folder import MANIFEST, write_files
from screwgauge.report.left_out import phrase
from screwgauge.report.pages import run as run_page
from screwgauge.report.pages.bench import PAGE as BENCH_PAGE
from screwgauge.report.pages.bench import SIMULATION, _error_and_time, make_plots
from screwgauge.report.pages.run import estimates, report, summary
from screwgauge.report.pages.run import terminal as run_in_terminal
from screwgauge.report.record import EXPORTED
from screwgauge.report.text import LINES
from screwgauge.report.verdict import conclusion, first_difference, verdict
from screwgauge.report.write import print_page, write_report
