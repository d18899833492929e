// The type of indices and counts. It is signed, so that differences and downward loops need no care, and a
// subscript takes it without a cast; sizes compare with it through std::ssize.
#pragma once

#include <cstddef>

namespace common {

using Index = std::ptrdiff_t;

}  // namespace common
