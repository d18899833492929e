#include "smartsurf/record/Hdf5Recorder.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstring>
#include <limits>
#include <mutex>

#include "smartsurf/record/Hdf5Meta.h"
#include "smartsurf/record/SurfaceLayout.h"

namespace smartsurf::record {
namespace {

constexpr std::size_t kMostBufferFrames = 64;
constexpr std::size_t kMostBufferBytes = 16u << 20;  // of all channels together
constexpr std::size_t kMostChunkBytes = 256u << 10;  // of a channel: what one frame's reader unpacks
constexpr std::size_t kMostBufferedChanges = 1u << 20;
constexpr std::uint64_t kMetadataBytes = 256u << 10;  // more than one write adds to the library's own tables
constexpr std::chrono::seconds kLongestWait{1};
constexpr float kNoNumber = std::numeric_limits<float>::quiet_NaN();

// The largest power of two, at most 64, of rows of this size that fit; so chunks divide the buffer evenly and
// a compressed chunk is packed once.
std::size_t frames_that_fit(std::size_t bytes, std::size_t bytes_a_frame) {
  const std::size_t fit = bytes / std::max<std::size_t>(bytes_a_frame, 1);
  return std::bit_floor(std::clamp<std::size_t>(fit, 1, kMostBufferFrames));
}

Handle create_file(const std::filesystem::path& path) {
  silence_error_stack();
  const Handle creation(H5Pcreate(H5P_FILE_CREATE), H5Pclose, "file properties");
  check(H5Pset_obj_track_times(creation, false), "file properties");
  return Handle(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, creation, H5P_DEFAULT), H5Fclose, "cannot be written");
}

bool good_channel_name(std::string_view name) {
  return !name.empty() && name != "." && name.find('/') == name.npos && name.find('\0') == name.npos;
}

// Planes of components in, cells with all their components out: files are read by cell.
void interleave(const Channel& channel, std::span<float> cells) {
  const auto components = static_cast<std::size_t>(channel.components);
  const std::size_t plane = cells.size() / components;
  for (std::size_t k = 0; k < components; ++k)
    for (std::size_t i = 0; i < plane; ++i) cells[i * components + k] = channel.values[k * plane + i];
}

}  // namespace

struct Hdf5Recorder::Content {
  Content(const std::filesystem::path& path, const Meta& meta, const scene::SceneSpec& spec)
      : record(spec.record), surface(spec.surface), file(create_file(path)), reserve(path) {
    write_meta(file, meta, spec);
    surface_group = write_surface(file, spec.surface);
    objects_group = create_group(file, "objects");
    catalogue.emplace(file, objects_group, spec.materials);
    catalogue->append(spec.objects);
    objects = spec.objects.size();
    flush();
  }

  void flush();
  template <class Action>
  void with_series(Action action);  // all but the ticks
  void create_series(const scene::Snapshot& first, std::span<const Channel> sensors,
                     std::span<const Channel> actuators);
  void create_channels(const char* group, std::span<const Channel> channels,
                       std::vector<FrameSeries>& series);
  FrameSeries grid(hid_t parent, std::string_view name, int rows, int columns, int components);
  FrameSeries poses(const char* name, hsize_t width);
  void add_objects(const std::vector<scene::ObjectSpec>& all);
  void buffer_objects(const scene::Snapshot& snapshot);
  void buffer_channels(std::span<const Channel> channels, std::vector<FrameSeries>& series);
  void buffer(const scene::Snapshot& snapshot, std::span<const Channel> sensors,
              std::span<const Channel> actuators);
  void log_inputs(std::span<const Channel> actuators);
  void write();

  scene::RecordSpec record;
  scene::SurfaceSpec surface;
  Handle file, surface_group, objects_group;
  FileReserve reserve;
  std::optional<CatalogueWriter> catalogue;
  std::vector<scene::ObjectSpec> newcomers;  // not yet in the file's catalogue
  std::size_t objects = 0;                   // in the catalogue, newcomers included
  scene::ObjectId first_live = 0,
                  end_live = 0;  // ids with a value in the buffered frames are in [first, end)

  bool ready = false;  // the series exist
  std::optional<FrameSeries> tick, time, hash, contacts, position, orientation, velocity, height;
  std::vector<FrameSeries> sensor_series, actuator_series;
  std::optional<ChangeWriter> inputs, heights, motion;
  std::vector<float> flat_motion;
  bool touched = false;
  std::size_t buffer_frames = 0, buffered = 0;
  hsize_t written = 0;
  std::chrono::steady_clock::time_point written_at = std::chrono::steady_clock::now();
};

FrameSeries Hdf5Recorder::Content::grid(hid_t parent, std::string_view name, int rows, int columns,
                                        int components) {
  FrameSeries::Layout layout{.type = H5T_NATIVE_FLOAT,
                             .row = {static_cast<hsize_t>(rows), static_cast<hsize_t>(columns)},
                             .compress = true,
                             .fill = FrameSeries::bytes_of(kNoNumber)};
  if (components > 1) layout.row.push_back(static_cast<hsize_t>(components));
  const std::size_t bytes = sizeof(float) * static_cast<std::size_t>(rows * columns * components);
  layout.chunk_frames = std::min(frames_that_fit(kMostChunkBytes, bytes), buffer_frames);
  return {parent, std::string(name), std::move(layout), buffer_frames};
}

FrameSeries Hdf5Recorder::Content::poses(const char* name, hsize_t width) {
  const hsize_t columns = std::clamp<hsize_t>(objects, 16, 256);
  return {objects_group, name,
          FrameSeries::Layout{.type = H5T_NATIVE_FLOAT,
                              .row = {objects, width},
                              .chunk_frames = buffer_frames,
                              .chunk_columns = columns,
                              .fill = FrameSeries::bytes_of(kNoNumber)},
          buffer_frames};
}

void Hdf5Recorder::Content::create_channels(const char* group, std::span<const Channel> channels,
                                            std::vector<FrameSeries>& series) {
  const Handle parent = create_group(file, group);
  for (const Channel& channel : channels) {
    if (!good_channel_name(channel.name))
      throw scene::InputError("channel '" + std::string(channel.name) +
                              "' cannot be recorded: its name must not be empty or contain '/'");
    series.push_back(grid(parent, channel.name, channel.rows, channel.columns, channel.components));
  }
}

void Hdf5Recorder::Content::create_series(const scene::Snapshot& first, std::span<const Channel> sensors,
                                          std::span<const Channel> actuators) {
  std::size_t bytes = record.objects ? objects * 10 * sizeof(float) : 0;
  if (record.sensors)
    for (const Channel& channel : sensors) bytes += channel.values.size_bytes();
  if (record.actuators) {
    for (const Channel& channel : actuators) bytes += channel.values.size_bytes();
    bytes += sizeof(float) * static_cast<std::size_t>(surface.cells());
  }
  buffer_frames = frames_that_fit(kMostBufferBytes, bytes);

  const auto numbers = [&](const char* name, hid_t type, auto no_value) {
    return FrameSeries(file, name,
                       {.type = type, .chunk_frames = 1024, .fill = FrameSeries::bytes_of(no_value)},
                       buffer_frames);
  };
  constexpr auto kNoTick = std::numeric_limits<std::uint64_t>::max();
  tick.emplace(numbers("tick", H5T_NATIVE_UINT64, kNoTick));
  time.emplace(numbers("time", H5T_NATIVE_DOUBLE, std::numeric_limits<double>::quiet_NaN()));
  hash.emplace(numbers("hash", H5T_NATIVE_UINT64, std::uint64_t{0}));
  contacts.emplace(numbers("contacts", H5T_NATIVE_UINT32, std::uint32_t{0}));
  if (record.objects) {
    position.emplace(poses("position", 3));
    orientation.emplace(poses("orientation", 4));
    velocity.emplace(poses("velocity", 3));
  }
  heights.emplace(surface_group, "changes", static_cast<std::size_t>(surface.cells()));
  if (!first.motion.empty())
    motion.emplace(surface_group, "motion", kMotionNumbers * static_cast<std::size_t>(surface.cells()));
  if (record.sensors) create_channels("sensors", sensors, sensor_series);
  if (record.actuators) {
    create_channels("actuators", actuators, actuator_series);
    height.emplace(grid(surface_group, "height", surface.rows, surface.columns, 1));
  }
  ready = true;
}

void Hdf5Recorder::Content::add_objects(const std::vector<scene::ObjectSpec>& all) {
  newcomers.insert(newcomers.end(), all.begin() + static_cast<std::ptrdiff_t>(objects), all.end());
  objects = all.size();
  if (!ready || !record.objects) return;
  for (FrameSeries* series : {&*position, &*orientation, &*velocity}) series->grow(objects);
}

void Hdf5Recorder::Content::buffer_objects(const scene::Snapshot& snapshot) {
  const std::span<float> p = position->row<float>(buffered), q = orientation->row<float>(buffered),
                         v = velocity->row<float>(buffered);
  for (const std::span<float> all : {p, q, v}) std::fill(all.begin(), all.end(), kNoNumber);
  for (std::size_t i = 0; i < snapshot.objects(); ++i) {
    const std::size_t id = snapshot.id[i];
    assert(id < objects);
    std::copy_n(snapshot.position[i].begin(), 3, p.begin() + static_cast<std::ptrdiff_t>(3 * id));
    std::copy_n(snapshot.orientation[i].begin(), 4, q.begin() + static_cast<std::ptrdiff_t>(4 * id));
    std::copy_n(snapshot.velocity[i].begin(), 3, v.begin() + static_cast<std::ptrdiff_t>(3 * id));
  }
  if (snapshot.id.empty()) return;
  first_live = end_live == 0 ? snapshot.id.front() : std::min(first_live, snapshot.id.front());
  end_live = std::max(end_live, snapshot.id.back() + 1);
}

void Hdf5Recorder::Content::buffer_channels(std::span<const Channel> channels,
                                            std::vector<FrameSeries>& series) {
  assert(channels.size() == series.size());
  for (std::size_t i = 0; i < series.size(); ++i) {
    const std::span<float> row = series[i].row<float>(buffered);
    assert(channels[i].values.size() == row.size());
    interleave(channels[i], row);
  }
}

void Hdf5Recorder::Content::buffer(const scene::Snapshot& snapshot, std::span<const Channel> sensors,
                                   std::span<const Channel> actuators) {
  tick->row<std::uint64_t>(buffered)[0] = snapshot.tick;
  time->row<double>(buffered)[0] = snapshot.time_s;
  hash->row<std::uint64_t>(buffered)[0] = snapshot.state_hash;
  contacts->row<std::uint32_t>(buffered)[0] = snapshot.contacts;
  if (record.objects) buffer_objects(snapshot);
  if (record.sensors) buffer_channels(sensors, sensor_series);
  if (record.actuators) {
    buffer_channels(actuators, actuator_series);
    const std::span<float> row = height->row<float>(buffered);
    assert(snapshot.height.size() == row.size());
    std::copy(snapshot.height.begin(), snapshot.height.end(), row.begin());
  }
  heights->add(snapshot.height, 0);
  heights->end_row();
  if (motion) {
    flatten(snapshot.motion, flat_motion);
    motion->add(flat_motion, 0);
    motion->end_row();
  }
  ++buffered;
}

template <class Action>
void Hdf5Recorder::Content::with_series(Action action) {
  for (auto* series : {&position, &orientation, &velocity, &height})
    if (*series) action(**series);
  for (FrameSeries& series : sensor_series) action(series);
  for (FrameSeries& series : actuator_series) action(series);
  for (auto* series : {&contacts, &hash, &time}) action(**series);
}

void Hdf5Recorder::Content::log_inputs(std::span<const Channel> actuators) {
  if (!inputs) {
    std::uint64_t values = 0;
    std::string names;
    for (const Channel& channel : actuators) {
      values += channel.values.size();
      names += (names.empty() ? "" : ",") + std::string(channel.name);
    }
    const Handle group = create_group(file, "inputs");
    write_attribute(group, "values", values);
    write_attribute(group, "channels", names);
    inputs.emplace(group, "changes", values);
  }
  std::size_t first = 0;
  for (const Channel& channel : actuators) {
    inputs->add(channel.values, first);
    first += channel.values.size();
  }
  inputs->end_row();
}

void Hdf5Recorder::Content::flush() {
  check(H5Fflush(file, H5F_SCOPE_LOCAL), "flush");
  hsize_t length = 0;
  check(H5Fget_filesize(file, &length), "length");
  reserve.give_back(length);
}

// A frame exists once it has its tick: the ticks are written and flushed when everything else already is, so
// that a kill in the middle cannot leave a frame that is half there.
void Hdf5Recorder::Content::write() {
  std::uint64_t most_bytes = kMetadataBytes + catalogue->most_bytes(newcomers);
  if (buffered > 0) {
    with_series([&](const FrameSeries& series) { most_bytes += series.most_bytes(); });
    most_bytes += tick->most_bytes();
  }
  for (auto* changes : {&inputs, &heights, &motion})
    if (*changes) most_bytes += (*changes)->most_bytes();
  reserve.reserve(most_bytes);
  catalogue->append(newcomers);
  newcomers.clear();
  for (auto* changes : {&inputs, &heights, &motion})
    if (*changes) (*changes)->write();
  if (buffered > 0) {
    with_series([&](FrameSeries& series) { series.write(written, buffered, first_live, end_live); });
    check(H5Fflush(file, H5F_SCOPE_LOCAL), "flush");
    tick->write(written, buffered);
  }
  flush();
  written += buffered;
  buffered = 0;
  first_live = end_live = 0;
  written_at = std::chrono::steady_clock::now();
}

namespace {

// Debian's library keeps its tables without locks: recorders of several worlds take turns in it.
std::mutex& library_turn() {
  static std::mutex turn;
  return turn;
}

}  // namespace

template <class Action>
void Hdf5Recorder::guarded(Action action) {
  const std::lock_guard turn(library_turn());
  if (!content_) return;
  try {
    action(*content_);
  } catch (const Hdf5Error& error) {
    content_.reset();
    throw std::runtime_error(name_ + ": cannot be written: " + error.what());
  }
}

Hdf5Recorder::Hdf5Recorder(const std::filesystem::path& path, const Meta& meta, const scene::SceneSpec& spec)
    : Recorder(spec.record.every), name_(path.string()) {
  const std::lock_guard turn(library_turn());
  try {
    content_ = std::make_unique<Content>(path, meta, spec);
  } catch (const Hdf5Error& error) {
    throw scene::InputError(name_ + ": cannot be written: " + error.what());
  }
}

Hdf5Recorder::~Hdf5Recorder() {
  try {
    guarded([](Content& content) { content.write(); });
  } catch (const std::runtime_error&) {  // a destructor has nobody to tell
  }
  const std::lock_guard turn(library_turn());
  content_.reset();
}

void Hdf5Recorder::record(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue,
                          std::span<const Channel> sensors, std::span<const Channel> actuators) {
  guarded([&](Content& content) {
    if (catalogue.size() > content.objects) content.add_objects(catalogue);
    if (!content.ready) content.create_series(snapshot, sensors, actuators);
    content.buffer(snapshot, sensors, actuators);
    // Whole chunks, also after a write that did not wait for the buffer to be full.
    if ((content.written + content.buffered) % content.buffer_frames == 0 ||
        content.heights->buffered_changes() > kMostBufferedChanges ||
        std::chrono::steady_clock::now() - content.written_at >= kLongestWait)
      content.write();
  });
}

void Hdf5Recorder::inputs(std::span<const Channel> actuators) {
  guarded([&](Content& content) {
    content.log_inputs(actuators);
    // Frames may be far apart.
    if (content.inputs->buffered_changes() > kMostBufferedChanges) content.write();
  });
}

void Hdf5Recorder::touched(std::uint64_t tick) {
  guarded([&](Content& content) {
    if (std::exchange(content.touched, true)) return;
    content.reserve.reserve(kMetadataBytes);
    const Handle meta(H5Gopen2(content.file, "meta", H5P_DEFAULT), H5Gclose, "group meta");
    write_attribute(meta, "touched_by_hand", tick);
    content.flush();
  });
}

void Hdf5Recorder::close(const Result& result) {
  guarded([&](Content& content) {
    content.write();
    content.reserve.reserve(kMetadataBytes + result.outcome.size());
    const Handle meta(H5Gopen2(content.file, "meta", H5P_DEFAULT), H5Gclose, "group meta");
    write_attribute(meta, "outcome", result.outcome);
    write_attribute(meta, "ticks", result.ticks);
    write_attribute(meta, "simulated_s", result.simulated_s);
    write_attribute(meta, "state_hash", result.state_hash);
    content.flush();
    content_.reset();
  });
}

}  // namespace smartsurf::record
