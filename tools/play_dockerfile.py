#!/usr/bin/env python3
"""Runs docker/Dockerfile without a container engine: each stage in a copy of a bare Debian root, by chroot.

    sudo tools/play_dockerfile.py BASE FOLDER [--built PREFIX]
                       BASE: a tar of the image that FROM names, or of a debootstrap root

With --built the stage that compiles is skipped, and its installed files come from PREFIX (cmake --install build/release --prefix).

Supports the instructions of the Dockerfile: FROM, WORKDIR, COPY, RUN, USER, ENTRYPOINT, CMD, HEALTHCHECK (ENV has no effect); others are an error. Leaves the
last stage in FOLDER/final. Then starts ENTRYPOINT with CMD as USER on a read-only root, where only /tmp and /var/cache/terrace can be written,
waits until HEALTHCHECK passes, fetches a tile, and sends SIGTERM, which must give exit code 0. Then reads the sample in other formats, and over HTTPS with
the image's certificates. Prints the size of the root and of its tar with gzip, as registries send it; fails if the latter is over 150 MB. Port 8080 must be
free. Needs root, gdal-bin and openssl, and uses the machine's network.
"""
import argparse
import fnmatch
import json
import os
import pathlib
import re
import shutil
import signal
import ssl
import subprocess
import sys
import tempfile
import time
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests/load"))
from range_server import RangeServer  # noqa: E402

PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


def instructions(text):
    text = re.sub(r"^\s*#.*\n", "", text, flags=re.MULTILINE).replace("\\\n", " ")
    for line in filter(str.strip, text.splitlines()):
        word, _, rest = line.strip().partition(" ")
        yield word.upper(), rest.strip()


def context():
    """Copies the files that COPY may read: those of the repository that .dockerignore does not exclude."""
    ignored = [line for line in (ROOT / ".dockerignore").read_text().splitlines() if line]
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout.split("\0")
    folder = pathlib.Path(tempfile.mkdtemp(prefix="context-"))
    for name in filter(None, names):
        parts = name.split("/")
        if any(fnmatch.fnmatch("/".join(parts[:count]), pattern) for pattern in ignored for count in range(1, len(parts) + 1)):
            continue
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name)
    return folder


LIMIT_MB = 150  # of the compressed image


def inside(root, command, user=None, workdir="/", read_only=False):
    """The command line of a process in `root` with its own mounts and process namespace, which end with it."""
    mounts = "mount --make-rprivate / && "
    if read_only:
        mounts += ("mount --bind {0} {0} && mount -o remount,ro,bind {0} && mount -t tmpfs -o mode=1777 tmp {0}/tmp && "
                   "mount -t tmpfs -o uid=10001 cache {0}/var/cache/terrace && ")
    mounts += "mount -t proc proc {0}/proc && mount --rbind /dev {0}/dev && "
    drop = f"--userspec={user} " if user else ""
    enter = "exec env -i PATH={1} HOME=/tmp chroot {2}{0} /bin/sh -c 'cd \"$0\" && exec \"$@\"' {3} \"$@\""
    script = (mounts + enter).format(root, PATH, drop, workdir)
    return ["unshare", "--mount", "--pid", "--fork", "--kill-child", "bash", "-c", script, "bash", *command]


def copy(source_root, root, workdir, rest, owner):
    *sources, target = rest.split()
    base = pathlib.Path(workdir) / target  # an absolute target replaces workdir
    destination = pathlib.Path(str(root) + str(base))
    into_folder = target.endswith("/") or len(sources) > 1 or target == "."
    for source in sources:
        path = source_root / source.lstrip("/")
        if path.is_dir():
            shutil.copytree(path, destination, symlinks=True, dirs_exist_ok=True)
            if owner is not None:
                for folder, _, names in os.walk(destination):
                    for name in [".", *names]:
                        os.lchown(os.path.join(folder, name), owner, 0)
        else:
            where = destination / path.name if into_folder else destination
            where.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, where)


def play(base, folder, built):
    files = context()
    stages, image = ({"build": built} if built else {}), {}
    skipped = False
    root, workdir = None, "/"
    for word, rest in instructions((ROOT / "docker/Dockerfile").read_text()):
        name = rest.split()[2] if " AS " in rest.upper() else "final"
        if word == "FROM":
            skipped = name in stages
        if skipped:
            continue
        print(f"+ {word} {rest}", flush=True)
        begun = time.monotonic()
        if word == "FROM":
            root, workdir, image = folder / name, "/", {}
            shutil.rmtree(root, ignore_errors=True)
            root.mkdir(parents=True)
            if rest.split()[0] != "scratch":
                subprocess.run(["tar", "-C", root, "-xf", base], check=True)
            stages[name] = root
        elif word == "WORKDIR":
            workdir = rest
            pathlib.Path(str(root) + rest).mkdir(parents=True, exist_ok=True)
        elif word == "COPY":
            source, owner = files, None
            if rest.startswith("--from="):
                stage, _, rest = rest[len("--from="):].partition(" ")
                source = stages[stage]
                if built:  # contains what the stage would install below /opt/terrace
                    rest = rest.replace("/opt/terrace", "/", 1)
            if rest.startswith("--chown="):
                flag, _, rest = rest.partition(" ")
                owner = int(re.match(r"--chown=(\d+)", flag)[1])
            copy(source, root, workdir, rest, owner)
        elif word == "RUN":
            command = json.loads(rest) if rest.startswith("[") else ["/bin/sh", "-c", rest]
            subprocess.run(inside(root, command, workdir=workdir), check=True, stdin=subprocess.DEVNULL)
            print(f"  {time.monotonic() - begun:.0f} s", flush=True)
        elif word in ("ENV", "USER", "ENTRYPOINT", "CMD", "HEALTHCHECK", "EXPOSE", "STOPSIGNAL"):
            image[word] = rest
        else:
            sys.exit(f"play_dockerfile: {word} is not known")
    shutil.rmtree(files)
    return root, image


def children_of(process):
    return [int(pid) for pid in subprocess.run(["pgrep", "-P", str(process.pid)], stdout=subprocess.PIPE, text=True).stdout.split()]


def smoke(root, image):
    command = json.loads(image["ENTRYPOINT"]) + json.loads(image["CMD"])
    health = json.loads(re.search(r"CMD (\[.*\])", image["HEALTHCHECK"])[1])
    server = subprocess.Popen(inside(root, command, image["USER"], read_only=True), stdin=subprocess.DEVNULL)
    try:
        for _ in range(60):
            if subprocess.run(inside(root, health, image["USER"])).returncode == 0:
                break
            if server.poll() is not None:
                sys.exit(f"play_dockerfile: the server ended with {server.returncode}")
            time.sleep(1)
        else:
            sys.exit("play_dockerfile: HEALTHCHECK never passed")
        with urllib.request.urlopen("http://127.0.0.1:8080/jacksboro/9/272/359.terrain", timeout=30) as reply:
            print(f"a tile: {reply.status}, {len(reply.read())} bytes")
        with urllib.request.urlopen("http://127.0.0.1:8080/viewer/cesium/index.js", timeout=30) as reply:
            assert len(reply.read()) > 1_000_000, "the viewer has no CesiumJS"
        child = children_of(server)[0]
        user = os.stat(f"/proc/{child}").st_uid
        assert user == int(image["USER"]), f"runs as {user}"
        os.kill(child, signal.SIGTERM)
        code = server.wait(40)
        assert code == 0, f"ended with {code}"
        assert subprocess.run(inside(root, health, image["USER"]), stderr=subprocess.DEVNULL).returncode != 0, "HEALTHCHECK passes without a server"
    finally:
        if server.poll() is None:
            server.kill()
    print(f"runs as {image['USER']} on a read-only root, healthy, ends with 0")


# What GDAL needs for each is loaded with it or opened by name: drivers, the data of PROJ, certificates.
FORMATS = {"COG": "tif", "netCDF": "nc", "JP2OpenJPEG": "jp2", "HFA": "img", "ENVI": "bil"}
BUNDLE = "etc/ssl/certs/ca-certificates.crt"


def read_formats(root, image):
    """Serves the sample in several formats as the image's user, and a COG over HTTPS whose authority is among the image's certificates."""
    folder = root / "tmp/formats"
    folder.mkdir()
    for driver, ending in FORMATS.items():
        subprocess.run(["gdal_translate", "-q", "-of", driver, ROOT / "config/samples/jacksboro.tif", folder / f"dem.{ending}"],
                       check=True)
    for file in folder.iterdir():
        file.chmod(0o644)
    bundle = (root / BUNDLE).read_bytes()
    with tempfile.TemporaryDirectory() as scratch, RangeServer(folder) as server:
        key, certificate = f"{scratch}/key", f"{scratch}/certificate"
        subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=127.0.0.1", "-addext",
                        "subjectAltName=IP:127.0.0.1", "-keyout", key, "-out", certificate], check=True, stderr=subprocess.DEVNULL)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(certificate, key)
        server.server.socket = context.wrap_socket(server.server.socket, server_side=True)
        remote = f"/vsicurl/{server.url.replace('http:', 'https:')}dem.tif"
        def is_served(source):
            command = ["terrace", "serve", "--listen", "127.0.0.1:8080", "--cache-dir", "none", "--allowed-prefixes", "/vsicurl/https://", "--", source]
            process = subprocess.Popen(inside(root, command, image["USER"]), text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            said = process.stdout.readline()  # empty if it ends
            for child in children_of(process):
                os.kill(child, signal.SIGKILL)  # it would outlive `unshare`, because its user is another one
            return said.startswith("terrace: serving"), process.communicate()[1]
        try:
            assert not is_served(remote)[0], "a certificate of an unknown authority was accepted"
            with (root / BUNDLE).open("ab") as file:
                file.write(pathlib.Path(certificate).read_bytes())
            for source in [remote, *(f"/tmp/formats/dem.{ending}" for ending in FORMATS.values())]:
                is_read, problem = is_served(source)
                assert is_read, f"{source}: {problem}"
        finally:
            (root / BUNDLE).write_bytes(bundle)
    shutil.rmtree(folder)
    print(f"reads {', '.join(FORMATS)}, and a COG over HTTPS")


def measure(root):
    def size(command):
        return int(subprocess.run(f"tar -C '{root}' --one-file-system -cf - . | {command}", shell=True, stdout=subprocess.PIPE, check=True).stdout)
    plain, packed = size("wc -c"), size("gzip -6 | wc -c")
    print(f"{plain / 1e6:.1f} MB, {packed / 1e6:.1f} MB with gzip")
    if packed > LIMIT_MB * 1e6:
        sys.exit(f"play_dockerfile: the image has more than {LIMIT_MB} MB with gzip")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("base", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--built", type=pathlib.Path)
    arguments = parser.parse_args()
    built = arguments.built and arguments.built.resolve()
    root, image = play(arguments.base.resolve(), arguments.folder.resolve(), built)
    smoke(root, image)
    read_formats(root, image)
    measure(root)


if __name__ == "__main__":
    main()
