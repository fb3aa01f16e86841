#include "engine/core/errno_text.h"

#include <system_error>

namespace terrace {

std::string ErrorText(int error) { return std::generic_category().message(error); }

}  // namespace terrace
