#include "tests/support/source_dir.h"

namespace terrace::test_support {

std::filesystem::path SourceDir() { return TERRACE_SOURCE_DIR; }

}  // namespace terrace::test_support
