#include "smartsurf/record/hdf5/ForkedRead.h"

#include <new>

#include "common/process/ChildWork.h"
#include "common/process/StopSignals.h"

namespace smartsurf::record {

std::string refusal_of_child(const std::filesystem::path& file, std::size_t memory_bytes,
                             const std::function<void()>& action) {
  constexpr int kMaxTime_s = 15;
  using End = common::ChildResult::End;
  const common::ChildLimits limits{.cpu_s = kMaxTime_s, .memory_bytes = memory_bytes, .readable = {file}};
  const auto work = [&] {
    try {
      action();
    } catch (const std::bad_alloc&) {  // here the library might not survive it
      throw;
    } catch (...) {  // the parent will get the same exception and reports it
    }
    return std::string();
  };
  const End end = common::run_in_child(work, limits).end;
  if (end == End::kStopped) throw common::Interrupted();
  if (end == End::kOutOfMemory) return "needs more memory than a reader of recordings may have";
  if (end == End::kOutOfTime)
    return "needs more than " + std::to_string(kMaxTime_s) + " s of processor time to be opened";
  return end == End::kReturned ? "" : "is damaged: the HDF5 library cannot read it";
}

}  // namespace smartsurf::record
