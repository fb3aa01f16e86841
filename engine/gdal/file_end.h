// The end of the samples in files of ENVI, netCDF and JPEG. GDAL's drivers of these formats return zeros, or grey,
// beyond the end of a file, without an error.
#pragma once

#include <gdal_priv.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace terrace::dem {

// Returns a lower bound of the size in bytes of an ENVI, a classic netCDF or a JPEG file that has all its samples; 0 if
// nothing is known, as for files of other formats and for a JPEG with its end marker.
std::uint64_t EndOfSamples(GDALDataset& dataset, const std::string& path);

// The same for the first bytes of a netCDF file. 0: it has no classic format (CDF-1, CDF-2, CDF-5; netCDF-4 has
// none), its header is damaged, or the header is not complete in `bytes`.
std::uint64_t EndOfClassicNetCdf(std::string_view bytes);

// The size in bytes that the first bytes of an HDF5 file state; netCDF-4 is HDF5. 0: they are no such header.
std::uint64_t EndOfHdf5(std::string_view bytes);

}  // namespace terrace::dem
