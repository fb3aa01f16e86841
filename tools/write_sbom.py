#!/usr/bin/env python3
"""Writes the bill of materials of a Debian package as CycloneDX 1.5 JSON.

    tools/write_sbom.py TERRACE.deb OUT.json [--boost PREFIX]     PREFIX: the folder with the Boost headers, by default .deps/boost

Components: the package; the Debian packages that it depends on, directly or through others, in the versions that are installed
here; the header-only libraries that its program contains; the npm packages of the viewer, from package-lock.json. Equal
input gives equal bytes: the time is SOURCE_DATE_EPOCH, the serial number is made from the package's hash.
"""
import argparse
import base64
import datetime
import hashlib
import json
import os
import pathlib
import re
import subprocess
import uuid

ROOT = pathlib.Path(__file__).resolve().parent.parent
# Their code is inside the program, so the package does not depend on them.
HEADER_ONLY = ["nlohmann-json3-dev", "libcli11-dev", "libexpected-dev", "libprotozero-dev"]
SPECIFICATION = "1.5"


def output(*command):
    return subprocess.run([str(part) for part in command], check=True, text=True, stdout=subprocess.PIPE).stdout


def installed_packages():
    """Name: (version, architecture, source, names of the packages that it depends on); provided names refer to their package."""
    fields = "${Package}\t${Version}\t${Architecture}\t${source:Package}\t${Provides}\t${Pre-Depends}, ${Depends}\t${db:Status-Status}\n"
    packages, provided = {}, {}
    for line in output("dpkg-query", "-W", "-f", fields).splitlines():
        name, version, architecture, source, provides, depends, status = line.split("\t")
        if status != "installed":
            continue
        packages[name] = (version, architecture, source, depends)
        for alias in filter(None, (part.split("(")[0].strip() for part in provides.split(","))):
            provided.setdefault(alias, name)
    return packages, provided


def names_of(depends):
    """Lists of alternatives: [["libgdal32"], ["a", "b"]]."""
    clauses = [clause for clause in depends.split(",") if clause.strip()]
    return [[re.split(r"[ (:]", choice.strip())[0] for choice in clause.split("|")] for clause in clauses]


def chosen(clause, packages, provided):
    for name in clause:
        if name in packages:
            return name
        if name in provided:
            return provided[name]
    return None


def debian_ref(name, packages):
    version, architecture, _, _ = packages[name]
    return f"pkg:deb/debian/{name}@{version.replace('+', '%2B').replace(':', '%3A')}?arch={architecture}&distro=debian-12"


def debian_component(name, packages, scope="required"):
    version, _, source, _ = packages[name]
    ref = debian_ref(name, packages)
    return {"type": "library", "bom-ref": ref, "name": name, "version": version, "scope": scope, "purl": ref,
            "properties": [{"name": "debian:source", "value": source}]}


def closure(names, packages, provided):
    """Name: names that it depends on, for all that are reached."""
    reached, open_names = {}, list(names)
    while open_names:
        name = open_names.pop()
        if name in reached:
            continue
        reached[name] = sorted({found for clause in names_of(packages[name][3]) if (found := chosen(clause, packages, provided))})
        open_names += reached[name]
    return reached


def boost(prefix):
    text = (prefix / "usr/include/boost/version.hpp").read_text()
    number = int(re.search(r"#define BOOST_VERSION (\d+)", text)[1])
    version = f"{number // 100000}.{number // 100 % 1000}.{number % 100}"
    return {"type": "library", "bom-ref": f"boost@{version}", "name": "boost", "version": version, "scope": "required",
            "licenses": [{"license": {"id": "BSL-1.0"}}], "cpe": f"cpe:2.3:a:boost:boost:{version}:*:*:*:*:*:*:*"}


def npm_components(lock):
    for place, entry in sorted(json.loads(lock.read_text())["packages"].items()):
        if not place or entry.get("dev"):
            continue
        name = place.split("node_modules/")[-1]
        ref = f"pkg:npm/{name.replace('@', '%40')}@{entry['version']}"
        component = {"type": "library", "bom-ref": ref, "name": name, "version": entry["version"], "scope": "required", "purl": ref}
        if entry.get("license"):
            component["licenses"] = [{"expression": entry["license"]}]
        if entry.get("integrity", "").startswith("sha512-"):
            digest = base64.b64decode(entry["integrity"].split("-", 1)[1]).hex()
            component["hashes"] = [{"alg": "SHA-512", "content": digest}]
        yield component


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("deb", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--boost", type=pathlib.Path, default=ROOT / ".deps/boost")
    arguments = parser.parse_args()
    packages, provided = installed_packages()
    version, depends = (output("dpkg-deb", "-f", arguments.deb, field).strip() for field in ("Version", "Depends"))
    digest = hashlib.sha256(arguments.deb.read_bytes()).hexdigest()
    direct = []
    for clause in names_of(depends):
        name = chosen(clause, packages, provided)
        if name is None:
            raise SystemExit(f"write_sbom: {' | '.join(clause)}, which {arguments.deb.name} depends on, is not installed; "
                             "tools/install_deps.sh installs it")
        direct.append(name)
    reached = closure(direct, packages, provided)
    inside = [boost(arguments.boost)] + [debian_component(name, packages) for name in HEADER_ONLY]
    viewer = list(npm_components(ROOT / "server/viewer/package-lock.json"))
    product = f"pkg:deb/terrace@{version}"
    components = [debian_component(name, packages) for name in sorted(reached)] + inside + viewer
    stamp = datetime.datetime.fromtimestamp(int(os.environ.get("SOURCE_DATE_EPOCH", "0")), datetime.timezone.utc)
    document = {
        "bomFormat": "CycloneDX", "specVersion": SPECIFICATION, "version": 1,
        "serialNumber": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, 'terrace:' + digest)}",
        "metadata": {
            "timestamp": stamp.strftime("%Y-%m-%dT%H:%M:%SZ"),
            "component": {"type": "application", "bom-ref": product, "name": "terrace", "version": version, "purl": product,
                          "licenses": [{"license": {"id": "Apache-2.0"}}], "hashes": [{"alg": "SHA-256", "content": digest}]},
        },
        "components": components,
        "dependencies": [
            {"ref": product, "dependsOn": sorted({debian_ref(name, packages) for name in direct}
                                                 | {component["bom-ref"] for component in inside + viewer})},
        ] + [{"ref": debian_ref(name, packages), "dependsOn": [debian_ref(other, packages) for other in others]}
             for name, others in sorted(reached.items())],
    }
    arguments.out.write_text(json.dumps(document, indent=1, sort_keys=True) + "\n")
    print(f"{arguments.out}: {len(components)} components")


if __name__ == "__main__":
    main()
