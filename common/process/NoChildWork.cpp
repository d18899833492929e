// ChildWork.h where there are no processes.
#include <stdexcept>

#include "common/process/ChildWork.h"

namespace common {

ChildResult run_in_child(const std::function<std::string()>&, const ChildLimits&) {
  throw std::runtime_error("there are no processes here");
}

void limit_address_space(std::size_t) {}

void limit_processor_time(double) {}

bool ran_out_of_time(int, const rusage&, double) noexcept { return false; }

double child_time_s() noexcept { return 0.0; }

}  // namespace common
