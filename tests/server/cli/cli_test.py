"""Runs the terrace binary without serving: cli_test.py BINARY SOURCE_DIR."""
import hashlib
import json
import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest

BINARY = pathlib.Path(sys.argv.pop(1)).resolve()
SOURCE_DIR = pathlib.Path(sys.argv.pop(1)).resolve()


def run(*arguments, cwd=None):
    return subprocess.run([str(BINARY), *map(str, arguments)], cwd=cwd, capture_output=True, text=True, timeout=60)


def flags_of(help_text):
    return set(re.findall(r"--[a-z][a-z-]*", help_text))


class Help(unittest.TestCase):
    def test_every_command_has_help_on_stdout(self):
        for command in ([], ["serve"], ["mesh"], ["info"]):
            result = run(*command, "--help")
            self.assertEqual((result.returncode, result.stderr), (0, ""), command)
            self.assertIn("Usage: terrace", result.stdout)

    def test_help_is_a_command_too(self):
        for arguments, same in ((["help"], ["--help"]), (["help", "mesh"], ["mesh", "--help"])):
            result, expected = run(*arguments), run(*same)
            self.assertEqual((result.returncode, result.stdout), (0, expected.stdout), arguments)

    def test_help_of_no_command_is_an_error(self):
        for arguments in (["help", "serv"], ["serv", "--help"]):
            result = run(*arguments)
            self.assertEqual((result.returncode, result.stdout), (2, ""), arguments)
            self.assertIn("terrace: unknown command serv; did you mean serve?\n", result.stderr)

    def test_baked_tiles_in_place_of_a_dem_say_what_serves_them(self):
        with tempfile.TemporaryDirectory() as place:
            folder = pathlib.Path(place)
            (folder / "0").mkdir()
            (folder / "layer.json").write_text("{}")
            result = run("serve", place)
            self.assertEqual(result.returncode, 2)
            self.assertIn("which any file server serves", result.stderr)
            (folder / "manifest.json").write_text("{}")
            self.assertIn("tiles.3tz has 3D Tiles for other programs; terrace serve needs", run("serve", folder / "tiles.3tz").stderr)
            self.assertIn(f"name its folder: terrace serve {place}\n", run("serve", str(folder / "manifest.json")).stderr)

    def test_a_wrong_command_below_another_leads_to_its_own_help(self):
        result = run("bake", "status")
        self.assertEqual((result.returncode, result.stderr), (2, "terrace: --queue is required\nRun 'terrace bake status --help' for what is accepted.\n"))

    def test_a_bake_that_has_not_finished_says_so(self):
        with tempfile.TemporaryDirectory() as place:
            (pathlib.Path(place) / "bake.json").write_text("{}")
            result = run("serve", place)
            self.assertEqual(result.returncode, 2)
            self.assertIn(f"{place} is a bake that has not finished", result.stderr)

    def test_a_file_in_place_of_a_command_is_served(self):
        self.assertIn(f"terrace: unknown command {__file__}; did you mean terrace serve {__file__}?\n", run(__file__).stderr)

    def test_lines_fit_a_terminal(self):
        for command in ([], ["serve"], ["mesh"], ["info"]):
            for line in run(*command, "--help").stdout.splitlines():
                self.assertLessEqual(len(line), 100, line)

    def test_defaults_are_what_the_flag_takes(self):
        text = " ".join(run("serve", "--help").stdout.split())
        for default in ("[127.0.0.1:8080]", "[256MiB]", "[public, max-age=3600]", "[*]", "[true]", "[crs]", "[10000]"):
            self.assertIn(default, text)
        self.assertNotIn('"', text)

    def test_version_is_the_projects(self):
        version = re.search(r"project\(.*?VERSION\s+([0-9.]+)", (SOURCE_DIR / "CMakeLists.txt").read_text(), re.S)
        result = run("--version")
        self.assertEqual((result.returncode, result.stdout), (0, f"terrace {version.group(1)}\n"))

    def test_the_manual_has_every_flag_of_serve_and_no_other(self):
        manual = (SOURCE_DIR / "docs/configuration.md").read_text(encoding="utf-8")
        documented = set(re.findall(r"^\|[^|]*?(?:\|[^|]*?)?`(--[a-z-]+)` \|", manual, re.M))
        self.assertEqual(flags_of(run("serve", "--help").stdout), documented)


class Usage(unittest.TestCase):
    def test_wrong_arguments_give_code_2_and_a_hint(self):
        for arguments in (["bake"], ["--bogus"], ["serve", "--bogus"], ["info"], ["mesh"], ["serve", "--listen"]):
            result = run(*arguments)
            self.assertEqual((result.returncode, result.stdout), (2, ""), arguments)
            self.assertRegex(result.stderr, r"^terrace: .+\nRun 'terrace .*--help' for what is accepted\.\n$")

    def test_what_the_parser_says_is_said_plainly(self):
        for arguments, message in ((["serve", "--listen"], "--listen needs a value: --listen HOST:PORT"),
                                   (["serve", "a.tif", "--name", "a", "--name", "b"], "--name is given more than once"),
                                   (["mesh", "a.tif", "b.tif", "--out", "c.obj"], "b.tif is one argument too many"),
                                   (["mesh", "a.tif", "-p", "4", "--out", "c.obj"], "unknown option -p"),
                                   (["mesh", "a.tif", "--points", "x", "--out", "c.obj"], '--points: must be a whole number from 4 (the corners of the raster) to 1000000000, not "x"')):
            self.assertEqual(run(*arguments).stderr.splitlines()[0], f"terrace: {message}", arguments)

    def test_empty_texts_are_refused(self):
        for arguments in (["serve", "a.tif", "--config"], ["bake", "a.tif", "--dry-run", "--levels"], ["bake", "a.tif", "--out", "b", "--queue"],
                          ["mesh", "a.tif", "--out", "c.obj", "--bbox"], ["info", "a.tif", "--draw"], ["fly", "http://a/b", "--report"]):
            result = run(*arguments, "")
            self.assertEqual((result.returncode, result.stdout), (2, ""), arguments)
            self.assertIn(f"terrace: the argument after {arguments[-1]} is empty; ", result.stderr)
        self.assertEqual(run("serve", "--cache-dir", "", "--print-config").returncode, 0, "an empty text is a value")
        self.assertNotIn("after --check-config", run("serve", "--check-config", "").stderr, "an option without a value")

    def test_an_option_is_no_value(self):
        for arguments, message in ((["bake", "a.tif", "--out", "--no-gzip"], "--out needs a value: --out PLACE; the option --no-gzip follows"),
                                   (["serve", "a.tif", "--listen", "--compact=true"], "--listen needs a value: --listen HOST:PORT; the option --compact follows"),
                                   (["bake", "status", "--queue", "--job", "a"], "--queue needs a value")):
            result = run(*arguments)
            self.assertEqual((result.returncode, result.stdout), (2, ""), arguments)
            self.assertIn(f"terrace: {message}", result.stderr)
        self.assertEqual(run("serve", "a.tif", "--floor", "-5", "--print-config").returncode, 0)

    def test_typos_are_told_with_the_nearest_name(self):
        for arguments, word, nearest in ((["serv"], "command serv", "serve"), (["--versoin"], "option --versoin", "--version"),
                                         (["serve", "--cach-bytes=5"], "option --cach-bytes", "--cache-bytes BYTES"),
                                         (["mesh", "--max-eror", "5"], "option --max-eror", "--max-error METRES"),
                                         (["mesh", "--jsn"], "option --jsn", "--json"),
                                         (["mesh", "--output", "a.obj"], "option --output", "--out FILE"),
                                         (["mesh", "--error", "5"], "option --error", "--max-error METRES"),
                                         (["serve", "--error", "5"], "option --error", "--error-fraction SHARE or --finest-error METRES")):
            self.assertIn(f"terrace: unknown {word}; did you mean {nearest}?\n", run(*arguments).stderr, arguments)

    def test_words_of_other_servers_lead_to_the_option(self):
        for flag in ("--port", "--host", "--address", "--bind"):
            self.assertIn(f"terrace: unknown option {flag}; did you mean --listen HOST:PORT?\n", run("serve", "a.tif", flag, "80").stderr)

    def test_options_of_another_command_are_told_with_it(self):
        for arguments, message in ((["mesh", "a.tif", "--listen", "a:1"], "--listen; it is one of 'terrace serve'"),
                                   (["serve", "a.tif", "--points=5"], "--points; it is one of 'terrace mesh'"),
                                   (["--listen=a:1", "serve"], "--listen before the command; it is one of 'terrace serve'"),
                                   (["mesh", "--port", "80"], "--port; did you mean --listen HOST:PORT of 'terrace serve'"),
                                   (["serve", "--tokens=abc"], '--tokens; "tokens" stands in the configuration alone')):
            self.assertIn(f"terrace: unknown option {message}", run(*arguments).stderr, arguments)

    def test_stdout_that_takes_nothing_is_a_failure(self):
        for arguments in (["serve", "--print-config"], ["--help"], ["--version"], ["bake", "--help"], ["help", "mesh"]):
            with open("/dev/full", "w", encoding="utf-8") as full:
                result = subprocess.run([BINARY, *arguments], stdout=full, stderr=subprocess.PIPE, timeout=60)
            self.assertEqual(result.returncode, 1, arguments)
            self.assertIn(b"stdout cannot be written: No space left on device", result.stderr, arguments)

    def test_no_arguments_give_code_2_and_the_help(self):
        result = run()
        self.assertEqual(result.returncode, 2)
        self.assertIn("Usage: terrace", result.stderr)

    def test_layers_of_another_place_are_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            far = pathlib.Path(folder) / "far.img"
            far.write_bytes(bytes([1] * 16))
            far.with_suffix(".hdr").write_text(
                "ENVI\nsamples = 4\nlines = 4\nbands = 1\ndata type = 1\ninterleave = bsq\nbyte order = 0\n"
                "map info = {Geographic Lat/Lon, 1, 1, 10, 20, 1, 1, WGS-84}\n")
            for flag, layer in (("--water", "water mask"), ("--imagery", "imagery")):
                result = run("serve", SOURCE_DIR / "config/samples/jacksboro.tif", flag, far, "--listen", "127.0.0.1:0")
                self.assertEqual((result.returncode, result.stdout), (1, ""), flag)
                self.assertIn(f"terrace: dataset jacksboro: {layer} {far}: covers longitudes 10.0000 to 14.0000",
                              result.stderr)

    def test_a_water_mask_that_is_no_file_may_be_meant_as_a_level(self):
        result = run("serve", SOURCE_DIR / "config/samples/jacksboro.tif", "--water", "/nowhere/deep")
        self.assertEqual((result.returncode, result.stdout), (1, ""))
        self.assertIn("give the path of a raster file on this machine, or for a sea level a number of metres\n", result.stderr)

    def test_a_missing_raster_gives_code_1(self):
        for command in ("serve", "info"):
            result = run(command, "/nowhere/dem.tif")
            self.assertEqual((result.returncode, result.stdout), (1, ""), command)
            self.assertIn("/nowhere/dem.tif", result.stderr)


class Config(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def write(self, text):
        path = self.folder / "terrace.json"
        path.write_text(text, encoding="utf-8")
        return path

    def test_printed_config_comes_back_the_same(self):
        runs = (["/data/my dem.tif", "--floor", "-3.5", "--cache-bytes", "1GiB", "--listen", "[::1]:0"],
                ["--config", SOURCE_DIR / "config/examples/production.json"],
                ["--config", SOURCE_DIR / "config/samples/samples.json", "--viewer", "false"])
        for arguments in runs:
            printed = run("serve", *arguments, "--print-config")
            self.assertEqual(printed.returncode, 0, printed.stderr)
            again = run("serve", "--config", self.write(printed.stdout), "--print-config")
            self.assertEqual((again.returncode, again.stdout), (0, printed.stdout), again.stderr)

    def test_a_start_fails_before_rasters_are_opened(self):
        dem = SOURCE_DIR / "config/samples/jacksboro.tif"
        config = json.dumps({"access_log": "json", "access_log_file": str(self.folder / "no/access.log"),
                             "datasets": [{"name": "a", "sources": [str(dem)]}, {"name": "b", "sources": ["b.tif"]}]})
        with socket.create_server(("127.0.0.1", 0)) as other:
            address = f"127.0.0.1:{other.getsockname()[1]}"
            start = run("serve", "--config", self.write(config), "--listen", address)
            self.assertEqual((start.returncode, start.stdout), (1, ""))
            for part in ("no/access.log", f"cannot listen on {address}", f"dataset b: {self.folder}/b.tif: No such file"):
                self.assertIn(part, start.stderr)
            self.assertNotIn("jacksboro", start.stderr)
            # The address is the running server's.
            check = run("serve", "--config", self.write(config), "--listen", address, "--check-config")
            self.assertEqual((check.returncode, check.stdout), (1, ""))
            self.assertNotIn("cannot listen", check.stderr)
            self.assertIn("dataset b", check.stderr)
            good = run("serve", dem, "--listen", address, "--check-config")
            self.assertEqual((good.returncode, good.stderr), (0, ""))
            self.assertIn("the configuration is fine: 1 dataset;", good.stdout)
        self.assertEqual(run("serve", dem, "--check-config", "--cache-bytes", "much").returncode, 2)

    def test_a_missing_file_with_a_similar_one_beside_it(self):
        (pathlib.Path(self.folder) / "valley.tif").write_bytes(b"")
        missing = run("serve", f"{self.folder}/valley.tfi")
        self.assertEqual(missing.returncode, 1)
        self.assertIn("valley.tfi: No such file or directory; give the path of a raster file on this machine; did you mean valley.tif?", missing.stderr)
        self.assertNotIn("did you mean", run("serve", f"{self.folder}/mountains.tif").stderr)

    def test_a_check_fails_where_a_start_would(self):
        dem = str(SOURCE_DIR / "config/samples/jacksboro.tif")
        (self.folder / "file").write_bytes(b"")
        (self.folder / "empty").mkdir()
        for code, options, words in ((1, {"data_roots": ["empty"]}, ["dataset a", "outside of the data roots"]),
                                     (2, {"data_roots": ["nowhere"]}, ["nowhere", "no folder"]),
                                     (2, {"allowed_drivers": ["Foo"]}, ["Foo", "no format"]),
                                     (2, {"allowed_prefixes": ["http://x"]}, ["allowed_prefixes", "/vsi"]),
                                     (1, {"disk_cache": {"directory": "file"}}, ["disk_cache", "Not a directory"]),
                                     (1, {"viewer": "nowhere"}, ["viewer", "nowhere", "no folder"]),
                                     (1, {"viewer": "nowhere", "access_log": "json", "access_log_file": "no/x.log",
                                          "tls": {"certificate": "a", "key": "b"}}, ["viewer", "no/x.log", "TLS"])):
            file = self.write(json.dumps({"datasets": [{"name": "a", "sources": [dem]}], **options}))
            for arguments in (["--check-config"], ["--listen", "127.0.0.1:0"]):
                result = run("serve", "--config", file, *arguments)
                self.assertEqual((result.returncode, result.stdout), (code, ""), (options, result.stderr))
                for word in words:
                    self.assertIn(word, result.stderr)
        for missing in ({"edits": ["a.geojson"]}, {"imagery": {"image": "a.tif"}}, {"water": {"mask": "a.tif"}}, {"vertical": "./a.gtx"},
                        {"sources": [{"path": dem, "vertical": "./a.gtx"}]}):
            file = self.write(json.dumps({"datasets": [{"name": "a", "sources": [dem], **missing}]}))
            result = run("serve", "--config", file, "--check-config")
            self.assertEqual(result.returncode, 1, missing)
            self.assertRegex(result.stderr, fr"dataset a: .*{self.folder}/(\./)?a\.(geojson|tif|gtx): No such file or directory; ")
        # Files of a folder that are not rasters do not belong to the dataset.
        (self.folder / "dems").mkdir()
        (self.folder / "dems/a.tif").symlink_to(dem)
        (self.folder / "dems/index.vrt").write_text("<VRTDataset>", encoding="utf-8")
        fine = self.write(json.dumps({"datasets": [{"name": "a", "sources": ["dems"]}], "disk_cache": {"directory": "x/y"},
                                      "access_log": "json", "access_log_file": "access.log"}))
        self.assertEqual(run("serve", "--config", fine, "--check-config").returncode, 0)
        # A created file would belong to the user who checks, who may differ from the server's user.
        self.assertFalse((self.folder / "x").exists() or (self.folder / "access.log").exists())

    def test_grids_lie_in_the_data_roots(self):
        (self.folder / "roots").mkdir()
        (self.folder / "roots/a.tif").symlink_to(SOURCE_DIR / "config/samples/jacksboro.tif")
        (self.folder / "grid.tif").write_bytes(b"")
        for dataset in ({"sources": ["roots"], "vertical": "./grid.tif"}, {"sources": [{"path": "roots", "vertical": "./grid.tif"}]}):
            file = self.write(json.dumps({"data_roots": ["roots", str(SOURCE_DIR)], "datasets": [{"name": "a", **dataset}]}))
            result = run("serve", "--config", file, "--check-config")
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertIn("grid.tif: lies outside of the data roots", result.stderr)

    def test_a_wrong_url_of_the_shared_cache_is_a_wrong_argument(self):
        result = run("serve", SOURCE_DIR / "config/samples/jacksboro.tif", "--shared-cache", "redis://h:99999/0", "--check-config")
        self.assertEqual((result.returncode, result.stdout), (2, ""), result.stderr)

    def test_bakes_take_no_options_in_vain(self):
        cells = ["bake", "--catalogue", self.write("N46E008\n"), "--dry-run"]
        for arguments, message in ((["bake", "a.tif", "--dry-run", "--ms-per-tile", "2"], "are assumptions for --catalogue"),
                                   (["bake", "a.tif", "--dry-run", "--dataset", "b", "--name", "c"], "--dataset and --name both name"),
                                   ([*cells, "--yes"], "and no other option"), ([*cells, "--threads", "2"], "and no other option")):
            result = run(*arguments)
            self.assertEqual((result.returncode, result.stdout), (2, ""), arguments)
            self.assertIn(message, result.stderr)
        self.assertEqual(run(*cells, "--ms-per-tile", "2").returncode, 0)

    def test_the_first_process_of_a_container_ends_by_sigterm(self):
        inside = ["unshare", "--user", "--map-root-user", "--pid", "--fork", "--kill-child", "--mount-proc"]
        if subprocess.run([*inside, "true"], stderr=subprocess.DEVNULL, check=False).returncode != 0:
            self.skipTest("no namespaces")
        out = self.folder / "first.obj"
        process = subprocess.Popen([*inside, "sh", "-c", 'exec "$0" "$@"', BINARY, "mesh", SOURCE_DIR / "config/samples/etopo5.tif", "--out", out, "--rms", "0"],
                                   stderr=subprocess.DEVNULL)
        self.addCleanup(process.kill)
        until = time.monotonic() + 60
        while not list(out.parent.glob("first.obj.*.part")):
            self.assertLess(time.monotonic(), until)
            time.sleep(0.02)
        child = int(subprocess.run(["pgrep", "-P", str(process.pid)], stdout=subprocess.PIPE, check=True).stdout)
        os.kill(child, signal.SIGTERM)
        self.assertEqual(process.wait(60), 143)
        self.assertEqual(list(out.parent.glob("first.obj*")), [])

    def test_an_option_without_effect_is_warned_of(self):
        file = self.write(json.dumps({"datasets": [{"name": "a", "sources": [str(SOURCE_DIR / "config/samples/jacksboro.tif")]}],
                                      "request_burst": 5, "access_log_file": "access.log"}))
        result = run("serve", "--config", file, "--check-config")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("access_log_file: has no effect, because it needs `access_log` to be `combined` or `json`", result.stderr)
        self.assertIn("request_burst: has no effect, because it needs `requests_per_second`", result.stderr)

    def test_equal_tokens_are_refused_with_their_place(self):
        tokens = [{"name": name, "token": "a-token-of-some-length"} for name in ("one", "two")]
        result = run("serve", "--config", self.write(json.dumps({"tokens": tokens})), "--print-config")
        self.assertEqual(result.returncode, 2)
        self.assertIn("/tokens/1: is the same token as /tokens/0", result.stderr)

    def test_a_secret_in_the_wrong_place_is_not_told(self):
        secret = "Vk3tSecretMarker42xyz"
        wrong = [{"tokens": secret}, {"tokens": [secret]}, {"tokens": {secret: ["a"]}}, {"tokens": [{"name": "a", "token": secret + "!"}]},
                 {"tokens": [{"name": secret + " ", "token": [secret]}]}, {"tokens": [{secret: "a"}]}, {"token": secret},
                 {"listen": secret}, {secret: secret}, {"tls": secret}, {"datasets": [{"name": "a", "sources": ["a.tif"], "floor": secret}]},
                 {"tls": {"certificate": "a.pem", "key": f"-----BEGIN PRIVATE KEY-----\n{secret}"}}]
        texts = [json.dumps(config) for config in wrong] + [f'{{"tokens": [{{"token": {secret}}}]}}', f'{{"tokens": ["{secret}]}}']
        for text in texts:
            result = run("serve", "--config", self.write(text), "--check-config")
            self.assertEqual(result.returncode, 2, text)
            self.assertNotIn(secret, result.stdout + result.stderr, text)
        for flags in ([f"--token={secret}"], ["--tokens", secret], [f"--print-config={secret}"], ["--listen", secret], [f"--io-threads={secret}"]):
            result = run("serve", *flags, "--check-config")
            self.assertEqual(result.returncode, 2, flags)
            self.assertNotIn(secret, result.stdout + result.stderr, flags)
        fine = self.write(json.dumps({"tokens": [{"name": "a", "token": secret}]}))
        printed = run("serve", "--config", fine, "--print-config")
        self.assertEqual(printed.returncode, 0, printed.stderr)
        self.assertNotIn(secret, printed.stdout + printed.stderr)
        self.assertEqual(json.loads(printed.stdout)["tokens"][0]["sha256"], hashlib.sha256(secret.encode()).hexdigest())

    def test_flags_override_the_file(self):
        file = self.write('{"listen": "127.0.0.1:1", "io_threads": 3, "datasets": [{"name": "a", "sources": ["a.tif"]}]}')
        config = json.loads(run("serve", "b.tif", "--config", file, "--listen", "127.0.0.1:2", "--print-config").stdout)
        self.assertEqual((config["listen"], config["io_threads"]), ("127.0.0.1:2", 3))
        self.assertEqual([dataset["name"] for dataset in config["datasets"]], ["a", "b"])

    def test_a_folder_is_one_dataset_of_its_name(self):
        folder = self.folder / "dems.v2"
        folder.mkdir()
        for name in ("b.tif", "a.tif"):
            (folder / name).write_bytes(b"")
        printed = run("serve", f"{folder}/", "--print-config")
        (dataset,) = json.loads(printed.stdout)["datasets"]
        self.assertEqual((dataset["name"], dataset["sources"]), ("dems.v2", [f"{folder}/"]))
        again = run("serve", "--config", self.write(printed.stdout), "--print-config")
        self.assertEqual((again.returncode, again.stdout), (0, printed.stdout), again.stderr)

    def test_defaults_are_printed_without_anything_to_serve(self):
        printed = run("serve", "--print-config")
        self.assertEqual((printed.returncode, json.loads(printed.stdout)["datasets"]), (0, []), printed.stderr)

    def test_a_wrong_flag_is_told_once_for_all_rasters(self):
        result = run("serve", "a.tif", "b.tif", "--floor", "low", "--name", "c")
        self.assertEqual(result.returncode, 2)
        self.assertEqual((result.stderr.count("--floor: "), result.stderr.count("--name: names one dataset")), (1, 1))

    def test_the_manuals_error_example_is_what_is_printed(self):
        manual = (SOURCE_DIR / "docs/configuration.md").read_text(encoding="utf-8").split("## Errors")[1]
        file, output = re.findall(r"```(?:json)?\n(.*?)```", manual, re.S)
        self.write(file)
        result = run("serve", "--config", "terrace.json", "--io-threads", "0", cwd=self.folder)
        self.assertEqual((result.returncode, result.stdout, result.stderr), (2, "", output))

    def test_dems_of_one_name_are_told_with_both_paths_and_the_remedy(self):
        config = self.write(json.dumps({"datasets": [{"name": "x", "sources": ["/c/y.tif"]}]}))
        for arguments, message in ((["/a/x.tif", "/b/x.tif"], '/a/x.tif and /b/x.tif would both be dataset "x", as DEMs are named after their files and archives after their datasets; '
                                                              "name both in a configuration (--config)"),
                                   (["a b.tif", "q.tif", "a-b.tif"], 'a b.tif and a-b.tif would both be dataset "a-b"'),
                                   (["x.tif", "x.tif"], "x.tif: is given twice; leave one out"),
                                   (["./x.tif", "x.tif"], "x.tif: is given twice; leave one out"),
                                   (["x.tif", "--config", config], 'x.tif: would be dataset "x", as one of the configuration is; give it another name with --name NAME'),
                                   (["x.tif", "y.tif", "--config", config], 'x.tif: would be dataset "x", as one of the configuration is; add it to the configuration')):
            result = run("serve", *arguments, "--check-config")
            self.assertEqual((result.returncode, result.stdout), (2, ""), arguments)
            self.assertIn(f"  {message}", result.stderr)
        self.assertEqual(run("serve", "x.tif", "--name", "z", "--config", config, "--print-config").returncode, 0)

    def test_wrong_configurations_give_code_2(self):
        for arguments, part in ((["/nowhere.tif", "--listen", "foo"], "--listen: has no port"),
                                (["--config", "/nowhere.json"], "cannot be read"),
                                (["--config", self.write("{,")], "line 1, column 2"),
                                (["--floor", "0"], '--floor: is for DEMs of the command line, of which there are none; for a dataset of the configuration write "floor"'),
                                ([], "there is nothing to serve")):
            result = run("serve", *arguments)
            self.assertEqual((result.returncode, result.stdout), (2, ""), arguments)
            self.assertIn(part, result.stderr)


if __name__ == "__main__":
    unittest.main()
