// The process-wide state of GDAL: drivers, settings that must hold before the first file is opened, and a silent error
// handler. Nothing here writes to stderr or to the network.
#pragma once

#include <string>

namespace terrace::dem {

// Registers drivers and settles the configuration, once per process. Thread-safe; cheap when done.
void InitGdal();

// The last failure GDAL or PROJ reported on this thread since the last call; "no further detail" when there was none.
// Library calls that can fail are preceded by ForgetGdalError, so that an older message cannot answer for a newer
// failure.
std::string TakeGdalError();
void ForgetGdalError();

}  // namespace terrace::dem
