#!/usr/bin/env python3
"""An area in QGIS as a mesh, and the dataset as a raster of heights: qgis_area.py [http://127.0.0.1:8080/jacksboro [OUT.png]]

Runs without a window (python3-qgis), and draws the map to OUT.png. In the Python console of QGIS it adds the layers to the project:
exec(open("examples/qgis_area.py").read()). The server has to be that of height_tiles.xml.
"""
import json
import os
import pathlib
import sys
import tempfile
import urllib.request

from qgis.core import (QgsApplication, QgsCoordinateReferenceSystem, QgsCoordinateTransform, QgsMapRendererParallelJob, QgsMapSettings,
                       QgsMeshDatasetIndex, QgsMeshLayer, QgsPointXY, QgsProject, QgsRasterLayer)
from qgis.PyQt.QtCore import QSize


# exec in the console has no file; it reads this one from here.
HERE = pathlib.Path(globals().get("__file__", "examples/qgis_area.py")).parent


def layers(dataset, folder, tiles):
    """The mesh of the middle fifth of a dataset, and the raster of its height tiles."""
    server, name = dataset.rsplit("/", 1)
    with urllib.request.urlopen(f"{server}/datasets") as reply:
        about = next((entry for entry in json.load(reply)["datasets"] if entry["name"] == name), None)
    if not about:
        sys.exit(f"{server} shows no dataset {name}: it is being prepared, needs a token, or has another name")
    west, south, east, north = about["bounds"]
    east += 360 * (west > east)  # across the antimeridian west is above east
    corners = [(west + share * (east - west), south + share * (north - south)) for share in (0.4, 0.6)]
    box = ",".join(f"{(longitude + 180) % 360 - 180},{latitude}" for longitude, latitude in corners)
    with urllib.request.urlopen(f"{dataset}/mesh?bbox={box}&error=5&format=ply&coordinates=geographic") as reply:
        pathlib.Path(folder, "area.ply").write_bytes(reply.read())
    mesh, raster = QgsMeshLayer(str(folder / "area.ply"), f"{name}, mesh", "mdal"), QgsRasterLayer(str(tiles), f"{name}, height tiles")
    mesh.setCrs(QgsCoordinateReferenceSystem("EPSG:4326"))
    return mesh, raster


def main(dataset="http://127.0.0.1:8080/jacksboro", out=None, tiles=None):
    folder = pathlib.Path(tempfile.mkdtemp())
    mesh, raster = layers(dataset, folder, tiles or HERE / "height_tiles.vrt")
    for layer in (mesh, raster):
        if not layer.isValid():
            sys.exit(f"QGIS cannot read {layer.source()}: {layer.error().message()}")
    QgsProject.instance().addMapLayers([raster, mesh])
    middle = mesh.extent().center()
    mesh.updateTriangularMesh()
    to_tiles = QgsCoordinateTransform(mesh.crs(), raster.crs(), QgsProject.instance())
    on_mesh = mesh.datasetValue(QgsMeshDatasetIndex(0, 0), QgsPointXY(middle)).scalar()
    on_raster, _ = raster.dataProvider().sample(to_tiles.transform(middle), 1)
    print(f"{middle.y():.6f}, {middle.x():.6f}: mesh {on_mesh:.2f} m with {mesh.dataProvider().faceCount()} triangles, height tiles {on_raster:.2f} m")
    if out:
        settings = QgsMapSettings()
        settings.setLayers([mesh, raster])
        settings.setDestinationCrs(mesh.crs())
        settings.setExtent(mesh.extent())
        settings.setOutputSize(QSize(600, 600))
        job = QgsMapRendererParallelJob(settings)
        job.start()
        job.waitForFinished()
        job.renderedImage().save(out)


if __name__ == "__main__":
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    application = QgsApplication([], False)
    application.initQgis()
    main(*sys.argv[1:])
    QgsProject.instance().clear()
    application.exitQgis()
elif QgsApplication.instance():  # the Python console
    main()
