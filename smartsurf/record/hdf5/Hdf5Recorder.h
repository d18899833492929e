// Records a run as HDF5 in the layout of docs/recordings.md. Internal to this module.
//
// A process killed at any time must leave a readable file. The recorder therefore uses the default (oldest)
// file format, writes in place, and flushes right after each write, before the library's cache evicts part of
// it. A file that could not be written is left as it is: to close it, the library would write again.
#pragma once

#include <chrono>
#include <memory>
#include <optional>

#include "smartsurf/record/Ownership.h"
#include "smartsurf/record/PendingFile.h"
#include "smartsurf/record/Recorder.h"
#include "smartsurf/record/hdf5/CatalogueWriter.h"
#include "smartsurf/record/hdf5/DeltaEncoding.h"
#include "smartsurf/record/hdf5/FilePreallocator.h"
#include "smartsurf/record/hdf5/FrameSeries.h"
#include "smartsurf/record/hdf5/Hdf5.h"

namespace smartsurf::record {

class Hdf5Recorder final : public Recorder {
 public:
  Hdf5Recorder(const std::filesystem::path& path, std::unique_ptr<PendingFile> pending,
               const RunMetadata& meta, const scene::SceneSpec& spec);
  ~Hdf5Recorder() override;
  void record_inputs(std::span<const scene::ChannelData> actuators) override;
  void mark_user_interaction(std::uint64_t tick) override;
  void record_registers(std::span<const scene::ChannelData> registers) override;
  void record_live(std::span<const LiveRow> rows) override;
  void flush() override;
  void close(const RunResult& result) override;

 private:
  struct OpenFile;  // the file and its datasets

  void write_frame(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                   std::span<const scene::ChannelData> sensors, std::span<const scene::ChannelData> actuators,
                   std::span<const NamedNumber> metrics) override;
  // Calls action(*open_file_) under the library's lock; does nothing once closed or failed, or in a
  // child of fork().
  template <class Action>
  void with_open_file(Action action);

  void abandon_file() noexcept;

  Owner owner_;
  std::string name_;
  std::unique_ptr<PendingFile> pending_;
  std::unique_ptr<OpenFile> open_file_;  // null once closed or failed
};

}  // namespace smartsurf::record
