#!/usr/bin/env bash
# Makes the two sample elevation models of config/samples from Debian packages that carry public-domain data. Needs
# apt-get, dpkg and gdal-bin. Installs nothing, and leaves only the two files.
#
#   tools/make_samples.sh [OUTPUT_DIRECTORY]     default: config/samples
set -euo pipefail
export LC_ALL=C
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
mkdir -p "${1:-$root/config/samples}"
out=$(cd "${1:-$root/config/samples}" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

echo "Fetching ferret-datasets and python-matplotlib-data (31 MB, not installed)"
apt-get -qq -o APT::Sandbox::User=root download ferret-datasets python-matplotlib-data
for package in *.deb; do dpkg -x "$package" unpacked; done
etopo5=$work/unpacked/usr/share/ferret-vis/data/etopo5.cdf
jacksboro=$work/unpacked/usr/share/matplotlib/mpl-data/sample_data/jacksboro_fault_dem.npz

geotiff=(-of GTiff -co TILED=YES -co BLOCKXSIZE=256 -co BLOCKYSIZE=256 -co COMPRESS=DEFLATE -co PREDICTOR=2 -co ZLEVEL=9
         -co NUM_THREADS=1)

# ETOPO5 has nodes every 5', from 0 to 359 55' E and from pole to pole. The eastern half moves in front of the western one,
# so that the columns run from -180.
cat > shifted.vrt <<VRT
<VRTDataset rasterXSize="4320" rasterYSize="2161">
  <SRS>EPSG:4326</SRS>
  <GeoTransform>-180.041666666666667, 0.083333333333333333, 0, 90.041666666666667, 0, -0.083333333333333333</GeoTransform>
  <VRTRasterBand dataType="Float32" band="1">
    <SimpleSource><SourceFilename>$etopo5</SourceFilename><SourceBand>1</SourceBand>
      <SrcRect xOff="2160" yOff="0" xSize="2160" ySize="2161"/><DstRect xOff="0" yOff="0" xSize="2160" ySize="2161"/>
    </SimpleSource>
    <SimpleSource><SourceFilename>$etopo5</SourceFilename><SourceBand>1</SourceBand>
      <SrcRect xOff="0" yOff="0" xSize="2160" ySize="2161"/><DstRect xOff="2160" yOff="0" xSize="2160" ySize="2161"/>
    </SimpleSource>
  </VRTRasterBand>
</VRTDataset>
VRT
# Takes every second node: the centres of the new 10' pixels are centres of old ones, so "nearest" is exact.
gdalwarp -q -r near -ot Int16 -te -180.08333333333333 -90.08333333333333 179.91666666666667 90.08333333333333 \
  -ts 2160 1081 -of VRT shifted.vrt thinned.vrt
gdal_translate -q -mo AREA_OR_POINT=Point "${geotiff[@]}" thinned.vrt "$out/etopo5.tif"

# The DEM that matplotlib's shading examples use: 344 rows of 403 little-endian 16-bit heights behind a NumPy header,
# the northern row first. xmin and xmax are the outer pixel edges (403 * 3"). ymax is the northern edge; the file's
# ymin, ymax + 344 * 3", is on the wrong side of ymax: the southern edge is ymax - 344 * 3". Then the highest sample,
# 1076 m, is on Cross Mountain (1077 m at 36.1983 N 84.2306 W); with the file's ymin it would be 32 km to the north.
python3 - "$jacksboro" > jacksboro.raw <<'PYTHON'
import struct, sys, zipfile
with zipfile.ZipFile(sys.argv[1]) as archive:
    raw = archive.read("elevation.npy")
header = 10 + struct.unpack("<H", raw[8:10])[0]
if b"'<i2', 'fortran_order': False, 'shape': (344, 403)" not in raw[:header]:
    sys.exit(f"jacksboro_fault_dem.npz changed: its elevation is now {raw[10:header]!r}")
sys.stdout.buffer.write(raw[header:])
PYTHON
cat > jacksboro.vrt <<VRT
<VRTDataset rasterXSize="403" rasterYSize="344">
  <SRS>EPSG:4326</SRS>
  <GeoTransform>-84.41375, 0.000833333333333333, 0, 36.44625, 0, -0.000833333333333333</GeoTransform>
  <VRTRasterBand dataType="Int16" band="1" subClass="VRTRawRasterBand">
    <SourceFilename relativeToVRT="1">jacksboro.raw</SourceFilename>
    <ImageOffset>0</ImageOffset><PixelOffset>2</PixelOffset><LineOffset>806</LineOffset><ByteOrder>LSB</ByteOrder>
  </VRTRasterBand>
</VRTDataset>
VRT
gdal_translate -q "${geotiff[@]}" jacksboro.vrt "$out/jacksboro.tif"

sha256sum "$out/etopo5.tif" "$out/jacksboro.tif"
