"""Results are whole or not there: after errors, full disks and signals, in real processes."""
from contextlib import suppress
import fcntl
import os
from pathlib import Path
import resource
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from sgor_ros.core.common.settings import InputError
from sgor_ros.io.bags import BagReader
from sgor_ros.io.writing import check_file
from sgor_ros.io.writing import free_folder
from sgor_ros.io.writing import new_file
from sgor_ros.io.writing import new_folder

SCANS = 3000    # so many that a signal comes long before the last one
DISK_BYTES = 400_000


class Stop(BaseException):
    pass


def command(name, *arguments, **options):
    return subprocess.Popen([sys.executable, '-m', f'sgor_ros.commands.{name}',
                             *map(str, arguments)], stderr=subprocess.PIPE, text=True, **options)


def ended(process):
    said = process.communicate(timeout=400)[1]
    return process.returncode, said


@pytest.fixture(scope='module')
def long_sequence(tmp_path_factory):
    """Return a sequence of many small scans: links to one file."""
    folder = tmp_path_factory.mktemp('kitti') / '08'
    for name in ('velodyne', 'labels'):
        (folder / name).mkdir(parents=True)
    rng = np.random.default_rng(0)
    rng.normal(0, 9, (500, 4)).astype(np.float32).tofile(folder / 'velodyne/000000.bin')
    np.full(500, 40, np.uint32).tofile(folder / 'labels/000000.label')
    for i in range(1, SCANS):
        os.link(folder / 'velodyne/000000.bin', folder / f'velodyne/{i:06d}.bin')
        os.link(folder / 'labels/000000.label', folder / f'labels/{i:06d}.label')
    (folder / 'times.txt').write_text(''.join(f'{i * 0.1:.6e}\n' for i in range(SCANS)))
    return folder


@pytest.fixture
def small_disk(tmp_path):
    """Return a folder on a disk that is soon full, and what a process needs to feel it."""
    disk = tmp_path / 'disk'
    disk.mkdir()
    mounted = subprocess.run(['mount', '-t', 'tmpfs', '-o', f'size={DISK_BYTES}', 'tmpfs', disk],
                             capture_output=True, check=False).returncode == 0
    if mounted:
        yield disk, {}
        subprocess.run(['umount', disk], check=True)
        return
    # the limit is for each file alone
    yield disk, {'preexec_fn': lambda: resource.setrlimit(
        resource.RLIMIT_FSIZE, (20_000, 20_000))}


def test_a_file_is_replaced_when_the_new_one_is_whole(tmp_path):
    path = tmp_path / 'result.json'
    path.write_text('old')
    with suppress(Stop), new_file(path) as place:
        place.write_text('half')
        raise Stop
    assert path.read_text() == 'old'
    with new_file(path) as place:
        place.write_text('new')
        assert path.read_text() == 'old'
    assert path.read_text() == 'new'
    assert list(tmp_path.iterdir()) == [path]


def test_what_is_no_plain_file_is_written_and_stays(tmp_path):
    (tmp_path / 'target').write_text('old')
    link = tmp_path / 'link'
    link.symlink_to('target')
    for path in (link, Path(os.devnull)):
        check_file(path, '--json')
        with new_file(path) as place:
            place.write_text('new')
    assert (tmp_path / 'target').read_text() == 'new'
    assert link.is_symlink()
    assert Path(os.devnull).is_char_device()


def test_a_folder_appears_whole_or_not_at_all(tmp_path):
    path = tmp_path / 'deep/out'
    with suppress(Stop), new_folder(path) as place:
        place.mkdir()
        raise Stop
    assert list(tmp_path.glob('deep/*')) == []
    with new_folder(path) as place:
        assert place.name == 'out'
        place.mkdir()
        (place / 'a').write_text('a')
        assert not path.exists()
    assert [p.name for p in tmp_path.glob('deep/**/*')] == ['out', 'a']
    with pytest.raises(InputError, match='out: exists already'), new_folder(path):
        pass


def test_a_folder_is_written_by_one_at_a_time(tmp_path):
    with new_folder(tmp_path / 'out') as place:
        place.mkdir()
        assert free_folder(tmp_path / 'out') == tmp_path / 'out_2'
        with pytest.raises(InputError, match='another process is writing it now'), \
                new_folder(tmp_path / 'out'):
            pass
        assert place.is_dir()
    assert free_folder(tmp_path / 'out') == tmp_path / 'out_2'
    (tmp_path / 'out_2').mkdir()
    assert free_folder(tmp_path / 'out') == tmp_path / 'out_3'
    (tmp_path / 'new.unfinished').mkdir()    # of a run that was killed: nobody holds it
    assert free_folder(tmp_path / 'new') == tmp_path / 'new'


def test_where_there_are_no_locks_it_writes_all_the_same(tmp_path, monkeypatch):
    def no_locks(*_):
        raise OSError(37, 'No locks available')
    monkeypatch.setattr(fcntl, 'flock', no_locks)
    with new_folder(tmp_path / 'out') as place:
        place.mkdir()
    assert (tmp_path / 'out').is_dir()


@pytest.mark.parametrize(('path', 'says'), [
    ('nowhere/a.png', 'no folder .*nowhere'), ('a.xyz', 'expected a name ending in .png'),
    ('folder.png', 'is a folder')])
def test_files_are_checked_before_the_work(path, says, tmp_path):
    (tmp_path / 'folder.png').mkdir()
    with pytest.raises(InputError, match=f'--plot .*{says}'):
        check_file(tmp_path / path, '--plot', ('.png',))
    check_file(tmp_path / 'good.PNG', '--plot', ('.png',))


@pytest.mark.parametrize(('number', 'code', 'left'), [
    (signal.SIGTERM, 143, []), (signal.SIGINT, 130, []),
    (signal.SIGKILL, -9, ['bag.unfinished'])])
def test_a_bag_ended_half_way(number, code, left, long_sequence, tmp_path):
    bag = tmp_path / 'bag'
    writing = command('kitti_to_bag', long_sequence, bag)
    while not any(path.stat().st_size for path in tmp_path.glob('bag.unfinished/bag/*.mcap')):
        assert writing.poll() is None, writing.stderr.read()
        time.sleep(0.002)
    writing.send_signal(number)
    found, said = ended(writing)
    assert found == code, said
    assert [path.name for path in tmp_path.iterdir()] == left
    assert ended(command('kitti_to_bag', long_sequence, bag))[0] == 0
    assert [path.name for path in tmp_path.iterdir()] == ['bag']
    with BagReader(bag) as reader:
        assert reader.cloud_topics() == {'/points': SCANS}


def test_a_bag_on_a_full_disk(long_sequence, small_disk):
    disk, limits = small_disk
    code, said = ended(command('kitti_to_bag', long_sequence, disk / 'bag', **limits))
    assert code == 3
    assert 'error: [Errno ' in said
    assert 'Traceback' not in said
    assert list(disk.iterdir()) == []


def test_results_on_a_full_disk(street, street_bag, small_disk, tmp_path):
    disk, limits = small_disk
    for name, (points, labels, _) in (('source', street[1]), ('target', street[0])):
        np.savez(tmp_path / f'{name}.npz', points=points, labels=labels)
    (disk / 'ballast').write_bytes(bytes(DISK_BYTES - 20_000))
    (disk / 'pair.png').write_text('old')
    for arguments, left in (
            (('register', tmp_path / 'source.npz', tmp_path / 'target.npz', '--plot',
              disk / 'pair.png'), {'ballast', 'pair.png'}),
            (('replay', street_bag, '--output', disk / 'out', '--bag'), {'ballast', 'pair.png'})):
        code, said = ended(command(*arguments, stdout=subprocess.DEVNULL, **limits))
        assert code == 3, said
        assert 'Traceback' not in said
        assert {path.name for path in disk.iterdir()} == left
        assert (disk / 'pair.png').read_text() == 'old'
