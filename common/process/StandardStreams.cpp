#include "common/process/StandardStreams.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

#include "common/process/ExitStatus.h"

namespace common {

void open_standard_streams() noexcept {
  for (int stream = 0; stream <= 2; ++stream) {
    if (::fcntl(stream, F_GETFD) >= 0 || errno != EBADF) continue;
    // The lowest free descriptor is this one.
    const int opened = stream == STDIN_FILENO ? ::open("/dev/full", O_WRONLY) : ::open("/dev/null", O_RDONLY);
    if (opened != stream) ::_exit(kFailed);
  }
}

}  // namespace common
