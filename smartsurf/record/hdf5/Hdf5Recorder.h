// Records a run as HDF5 in the layout of docs/recordings.md. Internal to this module.
//
// A kill at any moment must leave a readable file. Therefore the default (old) file format, writes in place,
// and a flush right after each write, before the library's cache can spill a part of it.
#pragma once

#include <chrono>
#include <memory>
#include <optional>

#include "smartsurf/record/Recorder.h"
#include "smartsurf/record/hdf5/CatalogueWriter.h"
#include "smartsurf/record/hdf5/DeltaEncoding.h"
#include "smartsurf/record/hdf5/FilePreallocator.h"
#include "smartsurf/record/hdf5/FrameSeries.h"
#include "smartsurf/record/hdf5/Hdf5.h"

namespace smartsurf::record {

class Hdf5Recorder final : public Recorder {
 public:
  Hdf5Recorder(const std::filesystem::path& path, const RunMetadata& meta, const scene::SceneSpec& spec);
  ~Hdf5Recorder() override;
  void record_inputs(std::span<const scene::ChannelData> actuators) override;
  void mark_user_interaction(std::uint64_t tick) override;
  void close(const RunResult& result) override;

 private:
  struct OpenFile;  // the open file and its datasets; gone once closed or failed

  void write_frame(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                   std::span<const scene::ChannelData> sensors, std::span<const scene::ChannelData> actuators) override;
  template <class Action>
  void with_open_file(Action action);

  std::string name_;
  std::unique_ptr<OpenFile> open_file_;
};

}  // namespace smartsurf::record
