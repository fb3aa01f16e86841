"""terrace mesh with colours: mesh_color_test.py BINARY SOURCE_DIR."""
import json
import math
import unittest

from mesh_info_test import BUMPS, PLACE, InFolder, area, grid, read_glb, read_obj, run

WIDTH, HEIGHT = 40, 30
PIXELS = [[(6 * x, 8 * y, 255 if (x - 20) ** 2 + (y - 15) ** 2 < 60 else 20) for x in range(WIDTH)]
          for y in range(HEIGHT)]
IMAGE = b"P6\n%d %d\n255\n" % (WIDTH, HEIGHT) + b"".join(bytes(pixel) for row in PIXELS for pixel in row)


def read_colors(path):
    lines = [line.split() for line in path.read_text().splitlines()]
    return [tuple(round(255 * float(share)) for share in line[4:7]) for line in lines if line and line[0] == "v"]


class Colored(InFolder):
    def setUp(self):
        super().setUp()
        self.dem = self.write("bumps.asc", grid(BUMPS, PLACE))
        self.image = self.write("photo.ppm", IMAGE)

    def mesh(self, raster, name, *arguments):
        out = self.folder / name
        result = run("mesh", raster, "--out", out, "--json", *arguments)
        self.assertEqual((result.returncode, result.stderr), (0, ""))
        return json.loads(result.stdout), out

    def measure(self, out, weight, span, heights):
        """The largest error by the paper's formula, and the colours' RMS, over every sample."""
        vertices, triangles = read_obj(out)
        colors = read_colors(out)
        worst = squares = 0
        for y in range(HEIGHT):
            for x in range(WIDTH):
                for triangle in triangles:
                    corners = [vertices[i] for i in triangle]
                    shares = [area((x, y), corners[i - 2], corners[i - 1]) / area(*corners) for i in range(3)]
                    if min(shares) > -1e-9:
                        dz = abs(sum(s * c[2] for s, c in zip(shares, corners)) - heights[y][x])
                        dc = [abs(sum(s * colors[i][k] for s, i in zip(shares, triangle)) - PIXELS[y][x][k]) / 255
                              for k in range(3)]
                        worst = max(worst, (1 - weight) * dz + weight * span / 3 * sum(dc))
                        squares += sum(d * d for d in dc)
                        break
                else:
                    self.fail(f"no triangle over {x}, {y}")
        return worst, math.sqrt(squares / (3 * WIDTH * HEIGHT))

    def test_keep_the_combined_error_they_promise(self):
        span = max(map(max, BUMPS)) - min(map(min, BUMPS))
        for weight, bound in ((0, 5), (0.1, 4), (0.5, 6), (1, 8)):
            statistics, out = self.mesh(self.dem, "a.obj", "--color", self.image, "--color-weight", weight,
                                        "--max-error", bound, "--coordinates", "pixel")
            worst, rms = self.measure(out, weight, span, BUMPS)
            self.assertLessEqual(worst, bound + 1e-9)
            color = statistics["color"]
            self.assertAlmostEqual(color["max_combined_error"], worst, delta=1e-3)
            self.assertAlmostEqual(color["rms_error"], rms, delta=1e-6)
            self.assertEqual((color["path"], color["weight"], color["samples"]), (str(self.image), weight, 1200))
            if weight < 1:
                self.assertLessEqual(statistics["max_error"], bound / (1 - weight) + 1e-9)

    def test_give_each_vertex_the_colour_of_its_sample(self):
        _, out = self.mesh(self.dem, "a.obj", "--color", self.image, "--points", 90, "--coordinates", "pixel")
        for (x, y, *_), color in zip(read_obj(out)[0], read_colors(out)):
            self.assertEqual(color, PIXELS[int(y)][int(x)])

    def test_of_no_weight_have_the_vertices_of_plain_ones(self):
        _, plain = self.mesh(self.dem, "a.obj", "--max-error", 3)
        _, colored = self.mesh(self.dem, "b.obj", "--max-error", 3, "--color", self.image, "--color-weight", 0)
        self.assertEqual(set(read_obj(plain)[0]), set(read_obj(colored)[0]))

    def test_are_in_every_format(self):
        for name in ("a.ply", "a.glb"):
            statistics, out = self.mesh(self.dem, name, "--color", self.image, "--points", 50)
            self.assertEqual(statistics["points"], 50)
        self.assertIn(b"property uchar red", (self.folder / "a.ply").read_bytes())
        gltf, buffer = read_glb(out)
        primitive = gltf["meshes"][0]["primitives"][0]
        accessor = gltf["accessors"][primitive["attributes"]["COLOR_0"]]
        self.assertEqual((accessor["count"], accessor["normalized"]), (50, True))
        view = gltf["bufferViews"][accessor["bufferView"]]
        self.assertEqual(view["byteOffset"] + view["byteLength"], len(buffer))

    def test_come_from_an_image_alone_upright(self):
        statistics, out = self.mesh(self.image, "a.obj", "--image", "--max-error", 0.1)
        vertices, triangles = read_obj(out)
        self.assertLess(len(vertices), WIDTH * HEIGHT)
        self.assertGreater(min(area(*(vertices[i] for i in t)) for t in triangles), 0)
        for (x, y, z), color in zip(vertices, read_colors(out)):
            self.assertEqual((z, color), (0, PIXELS[HEIGHT - 1 - int(y)][int(x)]))
        self.assertLessEqual(statistics["color"]["max_combined_error"], 0.1)
        self.assertEqual(statistics["color"]["weight"], 1)
        _, in_pixels = self.mesh(self.image, "b.obj", "--image", "--max-error", 0.1, "--coordinates", "pixel")
        flat = [[0] * WIDTH] * HEIGHT
        worst, rms = self.measure(in_pixels, 1, 1, flat)
        self.assertLessEqual(worst, 0.1 + 1e-9)
        self.assertAlmostEqual(rms, statistics["color"]["rms_error"], delta=1e-6)

    def test_say_what_is_wrong(self):
        out = self.folder / "a.obj"
        other = self.write("other.ppm", b"P6\n2 2\n255\n" + bytes(12))
        goal = ("--out", out, "--points", 9)
        for code, words, arguments in (
                (2, ["--color-weight requires --color"], (*goal, "--color-weight", 0.2)),
                (2, ["--color-weight", "0 to 1"], (*goal, "--color", self.image, "--color-weight", 1.5)),
                (2, ["excludes"], (*goal, "--color", self.image, "--image")),
                (2, ["--rms", "--max-error or --points"], ("--out", out, "--rms", 3, "--color", self.image)),
                (1, ["other.ppm has 2 x 2", "bumps.asc has 40 x 30", "-outsize 40 30"], (*goal, "--color", other)),
                (1, ["/nowhere.png", "No such file"], (*goal, "--color", "/nowhere.png")),
                (1, ["bumps.asc", "gdal_translate -ot Byte"], (*goal, "--image"))):
            self.assert_refused(code, words, "mesh", self.dem, *arguments)
        self.assertFalse(out.exists())


if __name__ == "__main__":
    unittest.main()
