"""The objects of an HDF5 file, examined before any of them is used.

HDF5 silently follows three kinds of references out of a file: links to other files, datasets stored in other files, and
datasets composed of those in others. With them a file from a stranger could read any file of the machine, or wait for ever
on a pipe. psim writes none of them.

Source: HDF5 Reference Manual, H5Lget_info, H5Oget_info, H5Pget_external, H5Pget_layout.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import h5py
from h5py import h5d, h5l, h5o

from particlesim.trajectory.hdf5 import open_alone

MOST_TEXT = 1 << 20
"""Strings in a dataset; a file with more is no trajectory, and is not read."""
_EXTERNAL_FILES = 1 << 7
"""In the set of messages of an object's header: its data are in other files."""


class ElsewhereError(Exception):
    """Data of an HDF5 file that are in other files; its text says which."""


def survey(path: Path) -> None:
    """Visit all links, objects, attributes and strings of a file, and every index of chunks: later readers meet nothing that
    this has not visited. Contents that are meaningless are left to them.

    Raises ElsewhereError for data in other files, before any of those is opened, and what HDF5 raises where links or objects
    cannot be read. In a file that was damaged, or made for that, it may crash, or not end.
    """
    with open_alone(path) as file:
        names = _inside(file)
        for name in names:
            _touch(file, name)


def _inside(file: h5py.File) -> list[bytes]:
    """The names of all objects but the root. Raises ElsewhereError unless all data are in the file."""
    names: list[bytes] = []
    others: list[bytes] = []

    def look(name: bytes, link: h5l.LinkInfo) -> None:
        if link.type == h5l.TYPE_HARD:
            names.append(name)
        elif link.type != h5l.TYPE_SOFT:
            others.append(name)

    file.id.links.visit(look, info=True)
    if others:
        raise ElsewhereError(f"/{_text(others[0])} is a link to another file")
    for name in names:
        found = h5o.get_info(file.id, name)
        if found.type == h5o.TYPE_DATASET:
            # Neither opens what is elsewhere; to ask for the length of a virtual dataset would.
            outside = found.hdr.mesg.present & _EXTERNAL_FILES
            if outside or h5d.open(file.id, name).get_create_plist().get_layout() == h5d.VIRTUAL:
                raise ElsewhereError(f"the data of /{_text(name)} are in another file")
    return names


def _touch(file: h5py.File, name: bytes) -> None:
    """Read what can lead a reader astray: attributes, text, the index of chunks. Numbers cannot."""
    with suppress(Exception):  # readers look only at some of it, and tell then what is wrong
        found = file[name]
        for key in list(found.attrs):
            with suppress(Exception):
                found.attrs[key]
        if isinstance(found, h5py.Dataset):
            if found.chunks is not None:
                found.id.get_num_chunks()
            if found.dtype.hasobject and found.size <= MOST_TEXT:
                found[()]


def _text(name: bytes) -> str:
    return name.decode("utf-8", "replace")
