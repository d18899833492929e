// Names of types in C++ kernels.
#pragma once

#include "apron/run/import/KernelPreprocessor.h"

namespace apron::run {

// Replaces the names of types, `typedef unsigned char byte;`, `using byte = uint8_t;` and `enum class Mode {
// … };`, by the types.
KernelTokenList without_aliases(const KernelTokenList&);

}  // namespace apron::run
