"""Run every protocol and study on a folder of data, and write the results page of the docs.

    python scripts/results_page.py ../shared/data ../shared/drives docs

Stopped, it goes on where it was. What it runs is the list below, each a call of `sgor_tables`.
"""
from pathlib import Path
import sys

from sgor_ros.commands import tables

OUT = Path('out/results')
QUICK = ['--methods', 'SGOR', 'SC2-PCR', 'SM']
HEAD = """# Results

Made by `scripts/results_page.py` from runs of [`sgor_tables`](tables.md) on what little data is at
hand: a few pairs each, so read the numbers of pairs before the percentages. Rows of other papers
stand beside each table of a run, and are left out here: they are of 555 or thousands of pairs.
Times are of a machine that did other things too. SGOR is the paper's steps on the matches that all
share; what this package does with two scans is in [figures](figures.md).
"""


def runs(data: Path, drives: Path) -> dict[str, tuple[str, list[str]]]:
    """Return name of the run to (title, arguments)."""
    pairs = ['poses', '--data', str(data), '--max-distance', '36']
    ten = [*pairs, '--limit', '10', '--front-end', 'paper', *QUICK]
    sets = ['matches', '--data', str(data / 'correspondences')]
    return {
        'kitti_10m': ('KITTI, pairs by the 10 m rule on one drive of 61 scans, no labels',
                      ['kitti-10m', '--data', str(drives / 'kitti_08b')]),
        'poses': ('KITTI and nuScenes, pairs up to 36 m apart, labels by hand or predicted',
                  [*pairs, '--limit', '24']),
        'poses_paper': ('The same pairs, matches of `SgorConfig.paper()`', [
            *pairs, '--limit', '24', '--front-end', 'paper', '--methods', 'SGOR', 'SC2-PCR',
            'SM', 'RANSAC', 'FGR', "KISS-Matcher's solver"]),
        'sets': ('KITTI, three sets of FPFH matches from elsewhere, no labels',
                 [*sets, '--sets', 'kitti_*']),
        'set_3dmatch': ('3DMatch, one set of matches from elsewhere',
                        [*sets, '--sets', '3d*', '--inlier', '0.1']),
        '3dmatch': ('3DMatch, one pair of fragments', ['3dmatch', '--data', str(data / 'indoor')]),
        'courtyard': ('A courtyard, no labels, without MAC, whose cliques take minutes here',
                      ['poses', '--data', str(drives / 'courtyard'), '--max-distance', '20',
                       '--limit', '12', '--methods', 'SGOR', 'SC2-PCR', 'SM', 'RANSAC', 'FGR',
                       "KISS-Matcher's solver"]),
        'matches': ('Study: number of matches (of `SgorConfig.paper()`)',
                    [*ten, '--study', 'matches']),
        'noise': ('Study: share of random labels (likewise)', [*ten, '--study', 'noise']),
        'categories': ('Study: categories that keep their labels',
                       [*ten, '--study', 'categories']),
        'ablation': ("Rows 1 to 9 of the paper's ablation on shared pairs",
                     [*pairs, '--limit', '16', '--front-end', 'paper', '--study', 'ablation'])}


def main() -> None:
    """Run what is missing, and write the page, without pictures: lines of ten pairs say little."""
    data, drives, docs = map(Path, sys.argv[1:4])
    text = [HEAD]
    for name, (title, arguments) in runs(data, drives).items():
        folder = OUT / name
        if tables.main([*arguments, '--output', str(folder)]):
            sys.exit(f'{name} failed')
        page = (folder / 'results.md').read_text()
        body = '\n'.join(line for line in page.splitlines()
                         if ', printed |' not in line and not line.startswith(('# ', '![')))
        text.append(f'## {title}\n\n{body.strip()}')
    (docs / 'results.md').write_text('\n\n'.join(text) + '\n')


if __name__ == '__main__':
    main()
