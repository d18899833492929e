#include "smartsurf/record/hdf5/ForkedRead.h"

#include <stdexcept>

#include "common/process/ChildWork.h"

namespace smartsurf::record {

bool completes_in_child(const std::filesystem::path& file, std::size_t memory_bytes,
                        const std::function<void()>& action) {
  const common::ChildLimits limits{.cpu_s = 15.0, .memory_bytes = memory_bytes, .readable = {file}};
  const auto work = [&] {
    try {
      action();
    } catch (...) {  // the parent will get the same exception and reports it
    }
    return std::string();
  };
  const common::ChildResult::End end = common::run_in_child(work, limits).end;
  if (end == common::ChildResult::End::kStopped) throw std::runtime_error("interrupted");
  return end == common::ChildResult::End::kReturned;
}

}  // namespace smartsurf::record
