// Which system calls a confined process may make, by libseccomp. Internal to this module.
#pragma once

#include "common/confine/Rights.h"

namespace common {

bool has_seccomp() noexcept;
// For all threads. Throws std::runtime_error.
void restrict_calls(Confinement::Calls);

}  // namespace common
