#include "common/threads/Core.h"

#ifdef __linux__
#include <sched.h>
#endif

namespace common {

#ifdef __linux__

int current_core() noexcept { return ::sched_getcpu(); }

void leave_core() noexcept {
  cpu_set_t allowed;
  if (::sched_getaffinity(0, sizeof allowed, &allowed) != 0) return;
  const int core = current_core();
  if (core < 0 || core >= CPU_SETSIZE) return;
  cpu_set_t others = allowed;
  CPU_CLR(core, &others);
  if (CPU_COUNT(&others) == 0 || ::sched_setaffinity(0, sizeof others, &others) != 0) return;
  ::sched_setaffinity(0, sizeof allowed, &allowed);
}

#else

int current_core() noexcept { return -1; }
void leave_core() noexcept {}

#endif

}  // namespace common
