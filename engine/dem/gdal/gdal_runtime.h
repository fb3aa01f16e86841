// The process-wide state of GDAL: drivers, settings that must hold before the first file is opened, and a silent error
// handler. Nothing here writes to stderr or to the network.
#pragma once

#include <string>

namespace terrace::dem {

// Registers drivers and settles the configuration, once per process. Thread-safe; cheap when done.
void InitGdal();

// The last error of GDAL or PROJ on this thread since the previous call; "no further detail" if there was none. Call
// ForgetGdalError before library calls that can fail, so that an older message is not reported for a newer error.
std::string TakeGdalError();
void ForgetGdalError();

}  // namespace terrace::dem
