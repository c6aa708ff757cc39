"""Pictures and numbers in, numbers out: no sockets, files, clocks or threads.

`frames` says where things are, `detect` finds markers in a picture, `pose` turns them into places.
"""
