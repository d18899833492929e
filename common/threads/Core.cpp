#include "common/threads/Core.h"

#ifdef __linux__
#include <fcntl.h>
#include <sched.h>
#include <unistd.h>

#include <cstdio>
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

CoreDemand core_demand() noexcept {
  const int file = ::open("/proc/loadavg", O_RDONLY | O_CLOEXEC);
  if (file < 0) return {0, 0};
  char text[128];
  const ssize_t length = ::read(file, text, sizeof text - 1);
  ::close(file);
  if (length <= 0) return {0, 0};
  text[length] = '\0';
  int runnable = 0;  // after three averages
  if (std::sscanf(text, "%*s %*s %*s %d/", &runnable) != 1 || runnable < 1) return {0, 0};
  return {runnable, static_cast<int>(::sysconf(_SC_NPROCESSORS_ONLN))};
}

#else

int current_core() noexcept { return -1; }
void leave_core() noexcept {}
CoreDemand core_demand() noexcept { return {0, 0}; }

#endif

}  // namespace common
