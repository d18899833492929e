// Landlock by its system calls: Debian 12 has no library for it, and its header ends at the second version.
// Internal to this module.
#pragma once

#include "common/confine/Rights.h"

namespace common {

int landlock_version() noexcept;  // 0: none
// Throws std::runtime_error.
void restrict_files(const Confinement&, int version);

}  // namespace common
