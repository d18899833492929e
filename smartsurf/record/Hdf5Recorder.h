// Writes a run as HDF5, in the layout of docs/recordings.md. Private to the room.
//
// A kill at any moment must leave a readable file, so: the library's default (old) file format, everything
// written in place, and a flush of the library right after each write, before its cache can spill a part of
// it.
#pragma once

#include <chrono>
#include <memory>
#include <optional>

#include "smartsurf/record/CatalogueWriter.h"
#include "smartsurf/record/ChangeLog.h"
#include "smartsurf/record/FileReserve.h"
#include "smartsurf/record/FrameSeries.h"
#include "smartsurf/record/Hdf5.h"
#include "smartsurf/record/Recorder.h"

namespace smartsurf::record {

class Hdf5Recorder final : public Recorder {
 public:
  Hdf5Recorder(const std::filesystem::path& path, const Meta& meta, const scene::SceneSpec& spec);
  ~Hdf5Recorder() override;
  void inputs(std::span<const Channel> actuators) override;
  void touched(std::uint64_t tick) override;
  void close(const Result& result) override;

 private:
  struct Content;  // the open file and its datasets; gone once closed or failed

  void record(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
              std::span<const Channel> sensors, std::span<const Channel> actuators) override;
  template <class Action>
  void guarded(Action action);

  std::string name_;
  std::unique_ptr<Content> content_;
};

}  // namespace smartsurf::record
