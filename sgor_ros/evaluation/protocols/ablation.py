"""The ablations: rows 1 to 9 of the paper's table, and each mechanism of ours off alone."""
from dataclasses import dataclass
from dataclasses import field

from ...core.common.settings import Value
from ...core.config import PAPER_STEPS
from ...core.config import SgorConfig
from ..methods import Method
from ..methods import sgor

WITHOUT: tuple[dict[str, Value], ...] = (
    *({name: value} for name, value in PAPER_STEPS.items()), {'scale': 1.0})
"""What is beyond the paper, turned off."""


@dataclass(frozen=True)
class PaperRow:
    """One row of the paper's ablation table.

    Attributes
    ----------
    number : int
    name : str
        As printed.
    recall : float
        As printed, with FPFH, percent.
    changes : dict
        What is off in it; nothing in those that the paper marks as its default.
    """

    number: int
    name: str
    recall: float
    changes: dict[str, Value] = field(default_factory=dict)

    @property
    def config(self) -> SgorConfig:
        """The configuration of this row."""
        return SgorConfig.paper().replace(**self.changes)

    @property
    def method(self) -> str:
        """What it is called among the methods: rows of the default are one method."""
        return f'paper, row {self.number}: {self.name}' if self.changes else 'paper'


PAPER_ROWS = (
    PaperRow(1, 'w/o preprocessing of correspondences', 89.01,
             {'correspondence_preprocessing': False}),
    PaperRow(2, 'w/ preprocessing of correspondences', 98.92),
    PaperRow(3, 'ground segmentation only by semantics', 90.21, {'secondary_ground': False}),
    PaperRow(4, 'secondary ground segmentation', 98.92),
    PaperRow(5, 'geometric-only SGOR', 91.35, {'semantics': 'none'}),
    PaperRow(6, 'semantic-hard SGOR', 95.81, {'semantics': 'hard'}),
    PaperRow(7, 'semantic-geometric SGOR', 98.92),
    PaperRow(8, 'verification without ground prior', 85.91, {'ground_check': False}),
    PaperRow(9, 'two-stage verification', 98.92))
"""Table V of the paper, over the 555 pairs of KITTI."""


def methods(threads: int, *, only_paper: bool = False) -> list[Method]:
    """Return the default, it without each of ours, the paper, its rows and its other readings."""
    default, paper = SgorConfig(), SgorConfig.paper()
    configs = {} if only_paper else {
        'default': default,
        **{_name(change): default.replace(**change) for change in WITHOUT}}
    configs['paper'] = paper
    configs |= {row.method: row.config for row in PAPER_ROWS}
    configs |= {'paper, wide reading of Eq. 3': paper.replace(labelled_ground=False),
                'kitti_protocol': SgorConfig.kitti_protocol()}
    return [sgor(name, config.replace(threads=threads)) for name, config in configs.items()]


def _name(change: dict[str, Value]) -> str:
    return ', '.join(f'{name}={value}' for name, value in change.items())
