// Writes trajectories as CSV, one line per object and frame: `tick,time,id,label,x,y,z,qx,qy,qz,qw`. Numbers
// are the shortest that read back to the same bits. Sensors, actuators and the run's result are not recorded.
#pragma once

#include <chrono>
#include <memory>
#include <optional>

#include "smartsurf/record/Ownership.h"
#include "smartsurf/record/PendingFile.h"
#include "smartsurf/record/Recorder.h"

namespace smartsurf::record {

class CsvRecorder final : public Recorder {
 public:
  CsvRecorder(const std::filesystem::path& path, std::unique_ptr<PendingFile> pending,
              const scene::SceneSpec& spec);
  ~CsvRecorder() override;
  void close(const RunResult& result) override;

 private:
  void write_frame(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                   std::span<const scene::ChannelData> sensors, std::span<const scene::ChannelData> actuators,
                   std::span<const NamedNumber> metrics) override;
  void flush_lines();
  void require_unchanged();
  int close_file() noexcept;
  bool is_writing() const noexcept { return fd_ >= 0 && !owner_.is_child(); }
  template <class Action>
  void commit(Action action);

  std::string name_;
  std::unique_ptr<PendingFile> pending_;
  bool has_frames_ = false;
  Owner owner_;
  int fd_ = -1;  // -1 once closed, or after a failed write
  std::optional<OwnedDescriptor> owned_fd_;
  std::string lines_;  // buffered output; always whole lines
  std::chrono::steady_clock::time_point last_flush_;
};

}  // namespace smartsurf::record
