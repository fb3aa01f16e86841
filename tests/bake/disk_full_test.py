"""A bake on a file system that is full for a while: disk_full_test.py BINARY. Needs to mount a tmpfs in a namespace of its own."""
import ctypes
import filecmp
import os
import pathlib
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "e2e"))
from srtm import write_hgt  # noqa: E402

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()


def mount_small_disk(path, size):
    """A tmpfs that only this process and its children see. False: the system does not permit it."""
    libc = ctypes.CDLL(None, use_errno=True)
    clone_newns, ms_rec, ms_private = 0x20000, 0x4000, 1 << 18
    if libc.unshare(clone_newns) != 0 or libc.mount(b"none", b"/", None, ms_rec | ms_private, None) != 0:
        return False
    return libc.mount(b"tmpfs", str(path).encode(), b"tmpfs", 0, f"size={size}".encode()) == 0


def unmount(path):
    detach = 2
    ctypes.CDLL(None).umount2(str(path).encode(), detach)


class DiskFull(unittest.TestCase):
    def test_full_for_a_while_the_files_are_the_same(self):
        with tempfile.TemporaryDirectory() as folder:
            scratch = pathlib.Path(folder)
            for cell in ("N46E006", "N46E007", "N47E012"):
                write_hgt(scratch / f"{cell}.hgt")

            def command(out, form):
                return [str(part) for part in (BINARY, "bake", *sorted(scratch.glob("*.hgt")), "--dataset", "d", "--vertical", "ellipsoid",
                                               "--levels", "0-10", "--format", "glb", "--cache-dir", scratch / "cache", "--threads", "1",
                                               "--form", form, "--out", out)]
            reference = scratch / "reference"
            done = subprocess.run(command(reference, "chunks"), capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            subprocess.run(command(scratch / "reference.3tz", "3tz"), check=True, capture_output=True)
            bytes_needed = sum(file.stat().st_size for file in reference.rglob("*") if file.is_file())
            disk = scratch / "disk"
            disk.mkdir()
            # Files wait in a spool beside them, so that there must be room for the largest twice.
            if not mount_small_disk(disk, 4 * bytes_needed):
                raise unittest.SkipTest("SKIPPED: mounting needs CAP_SYS_ADMIN")
            try:
                for out, form in ((disk / "out", "chunks"), (disk / "out.3tz", "3tz")):
                    ballast = disk / "ballast"
                    with open(ballast, "wb") as file:
                        free = os.statvfs(disk).f_bavail * os.statvfs(disk).f_frsize
                        file.write(bytes(max(0, free - bytes_needed // 3)))
                    full = subprocess.run(command(out, form), capture_output=True, text=True)
                    self.assertEqual(full.returncode, 1, full.stderr)
                    self.assertIn("No space left on device", full.stderr)
                    self.assertFalse((out / "manifest.json").exists())
                    # Now it is freed in mid-bake.
                    process = subprocess.Popen(command(out, form), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                    time.sleep(0.7)
                    ballast.unlink()
                    _, errors = process.communicate()
                    if process.returncode != 0:  # a unit failed three times before
                        again = subprocess.run(command(out, form), capture_output=True, text=True)
                        self.assertEqual(again.returncode, 0, (errors, again.stderr))
                    if form == "3tz":
                        self.assertEqual(out.read_bytes(), (scratch / "reference.3tz").read_bytes())
                        continue
                    names = sorted(path.relative_to(reference).as_posix() for path in reference.rglob("*") if path.is_file())
                    self.assertEqual(sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()), names)
                    self.assertEqual(filecmp.cmpfiles(reference, out, names, shallow=False)[1:], ([], []))
            finally:
                unmount(disk)


if __name__ == "__main__":
    result = unittest.main(exit=False).result
    sys.exit(77 if result.skipped else not result.wasSuccessful())
