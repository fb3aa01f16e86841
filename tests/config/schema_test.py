"""Checks config.schema.json with the example files and with cases.json: schema_test.py SOURCE_DIR."""
import json
import pathlib
import sys

try:
    from jsonschema import Draft202012Validator
except ImportError:
    print("SKIPPED: config_schema_test needs python3-jsonschema 4 (apt-get install python3-jsonschema)")
    sys.exit(77)

root = pathlib.Path(sys.argv[1])


def read(path):
    return json.loads((root / path).read_text(encoding="utf-8"))


schema = read("config/config.schema.json")
Draft202012Validator.check_schema(schema)
validator = Draft202012Validator(schema)
cases = read("tests/config/cases.json")
failures = []

files = sorted(str(path.relative_to(root)) for path in (root / "config/examples").glob("*.json"))
files.append("config/samples/samples.json")
named = [(name, read(name)) for name in files] + [(json.dumps(case), case) for case in cases["accepted"]]
for name, config in named:
    for error in validator.iter_errors(config):
        failures.append(f"refused, though right: {name}: {error.json_path}: {error.message}")

for case in cases["refused"]:
    # A missing or an unknown key is an error at the object that contains it.
    places = {"".join(f"/{part}" for part in error.absolute_path) for error in validator.iter_errors(case["config"])}
    if not places:
        failures.append(f"accepted, though wrong: {json.dumps(case['config'])}")
    elif case["path"] not in places and case["path"].rpartition("/")[0] not in places:
        failures.append(f"refused for another reason: {json.dumps(case['config'])}: {sorted(places)}")

print("\n".join(failures) or f"{len(named)} right and {len(cases['refused'])} wrong configurations are told apart")
sys.exit(1 if failures else 0)
