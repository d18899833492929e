#include "smartsurf/record/hdf5/ForkedRead.h"

#include <stdexcept>

#include "common/process/ChildWork.h"

namespace smartsurf::record {

bool completes_in_child(const std::function<void()>& action) {
  constexpr common::ChildLimits kLimits{.cpu_s = 15.0, .memory_bytes = std::size_t{8} << 30};
  const auto work = [&] {
    try {
      action();
    } catch (...) {  // the parent will get the same exception and reports it
    }
    return std::string();
  };
  const common::ChildResult::End end = common::run_in_child(work, kLimits).end;
  if (end == common::ChildResult::End::kStopped) throw std::runtime_error("interrupted");
  return end == common::ChildResult::End::kReturned;
}

}  // namespace smartsurf::record
