"""Pictures and numbers in, numbers out: no sockets, files, clocks or threads.

`frames` says where the camera looks, `lens` which ray a pixel is, `detect` finds markers in a picture (`corners` makes
them exact), `pose` turns them into places in the apartment.
"""
