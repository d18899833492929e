#include "smartsurf/record/hdf5/Hdf5Recorder.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstring>
#include <limits>
#include <mutex>
#include <system_error>

#include "smartsurf/record/hdf5/AttributeArchive.h"
#include "smartsurf/record/hdf5/Hdf5Meta.h"
#include "smartsurf/record/hdf5/Hdf5Reading.h"
#include "smartsurf/record/hdf5/Names.h"
#include "smartsurf/record/hdf5/SurfaceLayout.h"
#include "smartsurf/scene/KindRegistry.h"

namespace smartsurf::record {
namespace {

constexpr std::size_t kMaxBufferFrames = 64;
constexpr std::size_t kMaxBufferBytes = 16u << 20;  // all channels together
constexpr std::size_t kMaxChunkBytes = 256u << 10;  // per channel; a reader decompresses whole chunks
constexpr std::size_t kMaxBufferedChanges = 1u << 20;
constexpr double kCheapShare = 0.1;  // of the file, that sensors may take without being asked for
constexpr std::uint64_t kMetadataBytes = 256u << 10;  // upper bound of the library's metadata per write
constexpr std::uint64_t kMetricBytes = 1024;  // upper bound of an attribute, whose name has at most 192 bytes
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// The largest power of two, at most 64, of frames that fit into `bytes`. Powers of two make chunks divide the
// buffer evenly, so that each chunk is compressed only once.
std::size_t frames_that_fit(std::size_t bytes, std::size_t bytes_per_frame) {
  const std::size_t fit = bytes / std::max<std::size_t>(bytes_per_frame, 1);
  return std::bit_floor(std::clamp<std::size_t>(fit, 1, kMaxBufferFrames));
}

Handle create_file(const PendingFile& pending) {
  initialise_library();
  const Handle creation(H5Pcreate(H5P_FILE_CREATE), H5Pclose, "file properties");
  check(H5Pset_obj_track_times(creation, false), "file properties");
  return Handle(H5Fcreate(pending.path().c_str(), pending.must_be_new() ? H5F_ACC_EXCL : H5F_ACC_TRUNC,
                          creation, H5P_DEFAULT),
                H5Fclose, "cannot be written");
}

int descriptor_of(hid_t file) {
  void* descriptor = nullptr;
  check(H5Fget_vfd_handle(file, H5P_DEFAULT, &descriptor), "file descriptor");
  return *static_cast<const int*>(descriptor);
}

bool is_valid_channel_name(std::string_view name) {
  return !name.empty() && name != "." && name.find('/') == name.npos && name.find('\0') == name.npos;
}

// Converts component planes to cells with adjacent components, the file's layout.
void interleave_components(const scene::ChannelData& channel, std::span<float> cells) {
  const std::size_t components = channel.components;
  const std::size_t plane = cells.size() / components;
  for (std::size_t k = 0; k < components; ++k)
    for (std::size_t i = 0; i < plane; ++i) cells[i * components + k] = channel.values[k * plane + i];
}

}  // namespace

struct Hdf5Recorder::OpenFile {
  OpenFile(PendingFile& pending_file, const scene::SceneSpec& spec)
      : pending(pending_file),
        record(spec.record),
        surface(spec.surface),
        file(create_file(pending)),
        descriptor(descriptor_of(file)),
        preallocator(pending.path()) {}

  void write_declarations(const RunMetadata& meta, const scene::SceneSpec& spec) {
    live_channels = meta.live_channels;
    preallocator.preallocate(kMetadataBytes + 2 * (meta.program_text.size() + spec.source.size()));
    write_meta(file, meta, spec);
    write_surface(file, spec.surface);
    catalogue.emplace(file, create_group(file, paths::kObjects), spec.materials);
    catalogue->append(spec.objects);
    object_count = spec.objects.size();
    flush();
  }

  void flush();
  template <class Action>
  void for_each_series(Action action);  // all except tick
  void create_series(const scene::Snapshot& first, std::span<const scene::ChannelData> sensors,
                     std::span<const scene::ChannelData> actuators);
  // specs: the descriptions of the channels, by name.
  template <class ChannelSpec>
  void create_channels(const char* group, std::span<const scene::ChannelData> channels,
                       const std::vector<ChannelSpec>& specs, std::vector<FrameSeries>& series);
  FrameSeries make_grid_series(hid_t parent, std::string_view name, int rows, int columns, int components);
  FrameSeries make_pose_series(const char* name, hsize_t width);
  void add_objects(const std::vector<scene::ObjectSpec>& all);
  void buffer_objects(const scene::Snapshot& snapshot);
  void buffer_channels(std::span<const scene::ChannelData> channels, std::vector<FrameSeries>& series);
  void buffer_frame(const scene::Snapshot& snapshot, std::span<const scene::ChannelData> sensors,
                    std::span<const scene::ChannelData> actuators, std::span<const NamedNumber> metrics);
  void buffer_metrics(std::span<const NamedNumber> metrics);
  void keep_registers(std::span<const scene::ChannelData> all);
  template <class Number>
  FrameSeries make_number_series(hid_t parent, const std::string& name, Number no_value);
  void append_inputs(std::span<const scene::ChannelData> actuators);
  void keep_live(std::span<const LiveRow> rows);
  void create_live_series();
  void buffer_live();
  void write_buffered();
  void write_sensors();
  void drop_costly_sensors();
  void drop_sensors();
  void preallocate(std::uint64_t max_bytes, std::uint64_t max_sensor_bytes);

  PendingFile& pending;
  scene::RecordSpec record;
  scene::SurfaceSpec surface;
  Handle file;
  OwnedDescriptor descriptor;
  FilePreallocator preallocator;
  std::optional<CatalogueWriter> catalogue;
  std::vector<scene::ObjectSpec> pending_objects;  // not yet in the file's catalogue
  std::size_t object_count = 0;                    // including the pending ones
  // The ids with values in the buffered frames lie in [live_begin, live_end).
  scene::ObjectId live_begin = 0, live_end = 0;

  OpenFile* next_abandoned = nullptr;  // see abandon_file()
  bool series_created = false;
  std::optional<FrameSeries> tick, time, hash, contacts, position, orientation, velocity, angular_velocity,
      height;
  std::vector<FrameSeries> sensor_series, actuator_series, register_series;
  // Bytes of the sensor readings in the first judged_frames frames.
  std::uint64_t sensor_bytes = 0;
  hsize_t judged_frames = 0;
  bool closing = false;                           // the next write is the last one
  std::span<const scene::ChannelData> registers;  // of the next frame
  struct LiveSeries {
    std::string group, name;
    std::vector<std::uint64_t> words;  // of the next frame
    std::vector<float> reals;
    std::optional<FrameSeries> series;
  };
  std::vector<LiveSeries> live;
  std::vector<LiveChannel> live_channels;
  Handle metrics_group;
  std::vector<FrameSeries> metric_series;
  std::optional<DeltaWriter> inputs, heights, motion, skin;
  std::vector<float> flat_motion;
  bool interaction_marked = false;
  std::size_t buffer_capacity = 0, buffered_frames = 0;
  hsize_t written_frames = 0;
  std::chrono::steady_clock::time_point last_write = std::chrono::steady_clock::now();
};

FrameSeries Hdf5Recorder::OpenFile::make_grid_series(hid_t parent, std::string_view name, int rows,
                                                     int columns, int components) {
  FrameSeries::Layout layout{.type = H5T_NATIVE_FLOAT,
                             .row = {static_cast<hsize_t>(rows), static_cast<hsize_t>(columns)},
                             .compress = true,
                             .fill_value = FrameSeries::to_bytes(kNaN)};
  if (components > 1) layout.row.push_back(static_cast<hsize_t>(components));
  const std::size_t bytes = sizeof(float) * rows * columns * components;
  layout.chunk_frames = std::min(frames_that_fit(kMaxChunkBytes, bytes), buffer_capacity);
  return {parent, std::string(name), std::move(layout), buffer_capacity};
}

FrameSeries Hdf5Recorder::OpenFile::make_pose_series(const char* name, hsize_t width) {
  const hsize_t columns = std::clamp<hsize_t>(object_count, 16, 256);
  return {file, name,
          FrameSeries::Layout{.type = H5T_NATIVE_FLOAT,
                              .row = {object_count, width},
                              .chunk_frames = buffer_capacity,
                              .chunk_columns = columns,
                              .fill_value = FrameSeries::to_bytes(kNaN)},
          buffer_capacity};
}

template <class Number>
FrameSeries Hdf5Recorder::OpenFile::make_number_series(hid_t parent, const std::string& name,
                                                       Number no_value) {
  return {
      parent,
      name,
      {.type = native_type<Number>(), .chunk_frames = 1024, .fill_value = FrameSeries::to_bytes(no_value)},
      buffer_capacity};
}

template <class ChannelSpec>
void Hdf5Recorder::OpenFile::create_channels(const char* group, std::span<const scene::ChannelData> channels,
                                             const std::vector<ChannelSpec>& specs,
                                             std::vector<FrameSeries>& series) {
  const Handle parent = create_group(file, group);
  for (const scene::ChannelData& channel : channels) {
    if (!is_valid_channel_name(channel.name))
      throw scene::InputError("channel '" + std::string(channel.name) +
                              "' cannot be recorded: its name must not be empty or contain '/'");
    series.push_back(
        make_grid_series(parent, channel.name, channel.rows, channel.columns, channel.components));
    const auto spec = std::ranges::find(specs, channel.name, &ChannelSpec::name);
    if (spec == specs.end()) continue;
    archive_channel(AttributeWriter(series.back().dataset()), *spec);
  }
}

void Hdf5Recorder::OpenFile::create_series(const scene::Snapshot& first,
                                           std::span<const scene::ChannelData> sensors,
                                           std::span<const scene::ChannelData> actuators) {
  std::size_t bytes = record.objects ? object_count * 13 * sizeof(float) : 0;
  if (sensors.empty() && live_channels.empty()) record.sensors = scene::SensorRecording::kNever;
  const bool with_sensors = record.sensors != scene::SensorRecording::kNever;
  if (with_sensors)
    for (const scene::ChannelData& channel : sensors) bytes += channel.values.size_bytes();
  if (record.actuators) {
    for (const scene::ChannelData& channel : actuators) bytes += channel.values.size_bytes();
    bytes += sizeof(float) * surface.cell_count();
  }
  require_memory(bytes);
  buffer_capacity = frames_that_fit(kMaxBufferBytes, bytes);

  constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();
  tick.emplace(make_number_series(file, paths::kTick, std::numeric_limits<std::uint64_t>::max()));
  time.emplace(make_number_series(file, paths::kTime, kNoNumber));
  hash.emplace(make_number_series(file, paths::kHash, std::uint64_t{0}));
  contacts.emplace(make_number_series(file, paths::kContacts, std::uint32_t{0}));
  if (record.objects) {
    position.emplace(make_pose_series(paths::kPosition, 3));
    orientation.emplace(make_pose_series(paths::kOrientation, 4));
    velocity.emplace(make_pose_series(paths::kVelocity, 3));
    angular_velocity.emplace(make_pose_series(paths::kAngularVelocity, 3));
  }
  create_live_series();
  heights.emplace(file, paths::kHeightChanges, surface.cell_count());
  if (!first.actuator_state.empty())
    motion.emplace(file, paths::kMotion, kValuesPerActuatorState * surface.cell_count());
  if (surface.skin) skin.emplace(file, paths::kSkinHeight, first.skin_height.size());
  std::vector<LiveChannel> live_sensors, live_actuators;
  for (const LiveChannel& channel : live_channels) {
    auto& list = channel.sensor ? live_sensors : live_actuators;
    list.push_back(channel);
  }
  if (with_sensors && !live_channels.empty())
    create_channels(paths::kSensors, sensors, live_sensors, sensor_series);
  else if (with_sensors)
    create_channels(paths::kSensors, sensors, scene::collect_channels(surface.sensors), sensor_series);
  if (record.actuators) {
    if (!live_channels.empty())
      create_channels(paths::kActuators, actuators, live_actuators, actuator_series);
    else
      create_channels(paths::kActuators, actuators, surface.actuator_channels(), actuator_series);
    height.emplace(make_grid_series(file, paths::kHeight, surface.rows, surface.columns, 1));
  }
  series_created = true;
}

void Hdf5Recorder::OpenFile::add_objects(const std::vector<scene::ObjectSpec>& all) {
  pending_objects.insert(pending_objects.end(), all.begin() + object_count, all.end());
  object_count = all.size();
  if (!series_created || !record.objects) return;
  for (FrameSeries* series : {&*position, &*orientation, &*velocity, &*angular_velocity})
    series->grow_columns(object_count);
}

void Hdf5Recorder::OpenFile::buffer_objects(const scene::Snapshot& snapshot) {
  const std::span<float> p = position->row<float>(buffered_frames),
                         q = orientation->row<float>(buffered_frames),
                         v = velocity->row<float>(buffered_frames),
                         w = angular_velocity->row<float>(buffered_frames);
  for (const std::span<float> all : {p, q, v, w}) std::fill(all.begin(), all.end(), kNaN);
  for (std::size_t i = 0; i < snapshot.object_count(); ++i) {
    const std::size_t id = snapshot.id[i];
    assert(id < object_count);
    std::copy_n(snapshot.position[i].begin(), 3, p.begin() + 3 * id);
    std::copy_n(snapshot.orientation[i].begin(), 4, q.begin() + 4 * id);
    std::copy_n(snapshot.velocity[i].begin(), 3, v.begin() + 3 * id);
    std::copy_n(snapshot.angular_velocity[i].begin(), 3, w.begin() + 3 * id);
  }
  if (snapshot.id.empty()) return;
  live_begin = live_end == 0 ? snapshot.id.front() : std::min(live_begin, snapshot.id.front());
  live_end = std::max(live_end, snapshot.id.back() + 1);
}

void Hdf5Recorder::OpenFile::buffer_channels(std::span<const scene::ChannelData> channels,
                                             std::vector<FrameSeries>& series) {
  assert(channels.size() == series.size());
  for (std::size_t i = 0; i < series.size(); ++i) {
    const std::span<float> row = series[i].row<float>(buffered_frames);
    assert(channels[i].values.size() == row.size());
    interleave_components(channels[i], row);
  }
}

// Back-fills the earlier frames of a new metric with NaN.
void Hdf5Recorder::OpenFile::buffer_metrics(std::span<const NamedNumber> metrics) {
  for (std::size_t i = metric_series.size(); i < metrics.size(); ++i) {
    require_memory(0);
    if (metrics_group < 0) metrics_group = create_group(file, paths::kMetrics);
    metric_series.push_back(make_number_series(metrics_group, link_name(metrics[i].first),
                                               std::numeric_limits<double>::quiet_NaN()));
  }
  for (std::size_t i = 0; i < metrics.size(); ++i)
    metric_series[i].row<double>(buffered_frames)[0] = metrics[i].second;
}

// The frames before the program's first answer are NaN.
void Hdf5Recorder::OpenFile::keep_registers(std::span<const scene::ChannelData> all) {
  registers = all;
  if (registers.empty() || !register_series.empty() || !series_created) return;
  const std::size_t bytes = registers.size() * registers[0].values.size_bytes();
  require_memory(bytes);
  write_buffered();
  buffer_capacity = std::min(buffer_capacity, frames_that_fit(kMaxBufferBytes, bytes));
  create_channels(paths::kRegisters, registers, std::vector<LiveChannel>(), register_series);
}

void Hdf5Recorder::OpenFile::buffer_frame(const scene::Snapshot& snapshot,
                                          std::span<const scene::ChannelData> sensors,
                                          std::span<const scene::ChannelData> actuators,
                                          std::span<const NamedNumber> metrics) {
  tick->row<std::uint64_t>(buffered_frames)[0] = snapshot.tick;
  time->row<double>(buffered_frames)[0] = snapshot.time_s;
  hash->row<std::uint64_t>(buffered_frames)[0] = snapshot.state_hash;
  contacts->row<std::uint32_t>(buffered_frames)[0] = snapshot.contact_count;
  buffer_metrics(metrics);
  buffer_live();
  if (!register_series.empty()) buffer_channels(registers, register_series);
  if (record.objects) buffer_objects(snapshot);
  if (record.sensors != scene::SensorRecording::kNever) buffer_channels(sensors, sensor_series);
  if (record.actuators) {
    buffer_channels(actuators, actuator_series);
    const std::span<float> row = height->row<float>(buffered_frames);
    assert(snapshot.height.size() == row.size());
    std::copy(snapshot.height.begin(), snapshot.height.end(), row.begin());
  }
  heights->add(snapshot.height, 0);
  heights->end_row();
  if (motion) {
    flatten_actuator_state(snapshot.actuator_state, flat_motion);
    motion->add(flat_motion, 0);
    motion->end_row();
  }
  if (skin) {
    skin->add(snapshot.skin_height, 0);
    skin->end_row();
  }
  ++buffered_frames;
}

template <class Action>
void Hdf5Recorder::OpenFile::for_each_series(Action action) {
  for (auto* series : {&position, &orientation, &velocity, &angular_velocity, &height})
    if (*series) action(**series);
  for (FrameSeries& series : register_series) action(series);
  for (FrameSeries& series : actuator_series) action(series);
  for (FrameSeries& series : metric_series) action(series);
  for (LiveSeries& series : live) action(*series.series);
  for (auto* series : {&contacts, &hash, &time}) action(**series);
}

void Hdf5Recorder::OpenFile::keep_live(std::span<const LiveRow> rows) {
  if (live.empty())
    for (const LiveRow& row : rows)
      live.push_back({std::string(row.group), std::string(row.name), {}, {}, {}});
  assert(live.size() == rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    live[i].words.assign(rows[i].words.begin(), rows[i].words.end());
    live[i].reals.assign(rows[i].reals.begin(), rows[i].reals.end());
  }
}

void Hdf5Recorder::OpenFile::create_live_series() {
  std::string last_group;
  Handle group;
  for (LiveSeries& s : live) {
    if (!s.group.empty() && s.group != last_group) group = create_group(file, s.group.c_str());
    last_group = s.group;
    const bool reals = !s.reals.empty();
    FrameSeries::Layout layout{
        .type = reals ? H5T_NATIVE_FLOAT : H5T_NATIVE_UINT64,
        .chunk_frames = buffer_capacity,
        .compress = true,
        .fill_value = reals ? FrameSeries::to_bytes(kNaN) : FrameSeries::to_bytes(std::uint64_t{0})};
    const std::size_t width = reals ? s.reals.size() : s.words.size();
    if (width != 1) layout.row = {static_cast<hsize_t>(width)};
    s.series.emplace(s.group.empty() ? static_cast<hid_t>(file) : static_cast<hid_t>(group), s.name,
                     std::move(layout), buffer_capacity);
  }
}

void Hdf5Recorder::OpenFile::buffer_live() {
  for (LiveSeries& s : live)
    if (s.reals.empty())
      std::ranges::copy(s.words, s.series->row<std::uint64_t>(buffered_frames).begin());
    else
      std::ranges::copy(s.reals, s.series->row<float>(buffered_frames).begin());
}

void Hdf5Recorder::OpenFile::append_inputs(std::span<const scene::ChannelData> actuators) {
  if (!inputs) {
    require_memory(0);
    std::uint64_t values = 0;
    std::string names;
    for (const scene::ChannelData& channel : actuators) {
      values += channel.values.size();
      names += (names.empty() ? "" : ",") + std::string(channel.name);
    }
    const Handle group = create_group(file, paths::kInputs);
    write_attribute(group, paths::kInputValues, values);
    write_attribute(group, "channels", names);
    inputs.emplace(file, paths::kInputChanges, values);
  }
  std::size_t first = 0;
  for (const scene::ChannelData& channel : actuators) {
    inputs->add(channel.values, first);
    first += channel.values.size();
  }
  inputs->end_row();
}

void Hdf5Recorder::OpenFile::flush() {
  check_closed();
  check(H5Fflush(file, H5F_SCOPE_LOCAL), "flush");
  hsize_t length = 0;
  check(H5Fget_filesize(file, &length), "length");
  preallocator.truncate(length);
  pending.note_length(static_cast<off_t>(length));
}

// Sensors lie behind the rest, so that the file shrinks where they leave it at once.
void Hdf5Recorder::OpenFile::write_sensors() {
  if (sensor_series.empty()) return;
  for (FrameSeries& series : sensor_series) series.write(written_frames, buffered_frames);
  check_closed();
  check(H5Fflush(file, H5F_SCOPE_LOCAL), "flush");
  if ((written_frames + buffered_frames) % kMaxBufferFrames == 0 || (closing && judged_frames == 0))
    drop_costly_sensors();
}

// Sensors that nobody asked for leave the file once they take more than kCheapShare of it. Whole buffers
// alone are judged, and shorter recordings at their end, because an early write, which depends on the clock,
// must not decide.
void Hdf5Recorder::OpenFile::drop_costly_sensors() {
  if (record.sensors != scene::SensorRecording::kWhereCheap) return;
  const hsize_t frames = written_frames + buffered_frames;
  for (const FrameSeries& series : sensor_series)
    sensor_bytes += series.stored_bytes(judged_frames, frames - judged_frames);
  judged_frames = frames;
  hsize_t length = 0;
  check(H5Fget_filesize(file, &length), "length");
  const hssize_t unused = H5Fget_freespace(file);
  check(unused < 0 ? -1 : 0, "free space");
  if (static_cast<double>(sensor_bytes) <=
      kCheapShare * static_cast<double>(length - static_cast<hsize_t>(unused)))
    return;
  drop_sensors();
}

void Hdf5Recorder::OpenFile::drop_sensors() {
  record.sensors = scene::SensorRecording::kNever;
  sensor_series.clear();
  check_closed();
  check(H5Ldelete(file, paths::kSensors, H5P_DEFAULT), paths::kSensors);
  check(H5Fflush(file, H5F_SCOPE_LOCAL), "flush");
}

// If the disk lacks room for sensors that are recorded by default, records without them.
void Hdf5Recorder::OpenFile::preallocate(std::uint64_t max_bytes, std::uint64_t max_sensor_bytes) {
  try {
    preallocator.preallocate(max_bytes + max_sensor_bytes);
  } catch (const Hdf5Error&) {
    if (sensor_series.empty() || record.sensors != scene::SensorRecording::kWhereCheap) throw;
    drop_sensors();
    preallocator.preallocate(max_bytes);
  }
}

// A frame exists once its tick is stored. Ticks are written and flushed after everything else, so a process
// killed in between cannot leave a partial frame.
void Hdf5Recorder::OpenFile::write_buffered() {
  pending.require_unchanged();
  std::uint64_t max_bytes = kMetadataBytes + catalogue->max_bytes(pending_objects), max_sensor_bytes = 0;
  if (buffered_frames > 0) {
    for_each_series([&](const FrameSeries& series) { max_bytes += series.max_bytes(); });
    for (const FrameSeries& series : sensor_series) max_sensor_bytes += series.max_bytes();
    max_bytes += tick->max_bytes();
  }
  for (auto* changes : {&inputs, &heights, &motion, &skin})
    if (*changes) max_bytes += (*changes)->max_bytes();
  preallocate(max_bytes, max_sensor_bytes);
  require_memory(max_bytes + max_sensor_bytes);
  catalogue->append(pending_objects);
  pending_objects.clear();
  for (auto* changes : {&inputs, &heights, &motion, &skin})
    if (*changes) (*changes)->write();
  if (buffered_frames > 0) {
    for_each_series(
        [&](FrameSeries& series) { series.write(written_frames, buffered_frames, live_begin, live_end); });
    check_closed();
    check(H5Fflush(file, H5F_SCOPE_LOCAL), "flush");
    write_sensors();
    tick->write(written_frames, buffered_frames);
  }
  flush();
  written_frames += buffered_frames;
  buffered_frames = 0;
  live_begin = live_end = 0;
  last_write = std::chrono::steady_clock::now();
}

namespace {

// Debian builds HDF5 without locks; the recorders of several worlds share this one.
std::mutex& library_mutex() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace

// Keeps the file open until the process ends, in a list that needs no memory.
void Hdf5Recorder::abandon_file() noexcept {
  static OpenFile* abandoned = nullptr;
  if (!open_file_) return;
  open_file_->next_abandoned = abandoned;
  abandoned = open_file_.release();
}

template <class Action>
void Hdf5Recorder::with_open_file(Action action) {
  if (owner_.is_child()) return;  // where another thread of the parent may hold the lock
  const std::lock_guard lock(library_mutex());
  if (!open_file_) return;
  std::string reason;
  try {
    action(*open_file_);
    return;
  } catch (const Hdf5Error& error) {
    reason = error.what();
  } catch (const std::system_error& error) {
    reason = error.code().message();
  } catch (const std::exception&) {
    abandon_file();
    throw;
  }
  abandon_file();
  throw std::runtime_error(name_ + ": cannot be written: " + reason);
}

Hdf5Recorder::Hdf5Recorder(const std::filesystem::path& path, std::unique_ptr<PendingFile> pending,
                           const RunMetadata& meta, const scene::SceneSpec& spec)
    : Recorder(spec.record.tick_interval), name_(path.string()), pending_(std::move(pending)) {
  const std::lock_guard lock(library_mutex());
  try {
    open_file_ = std::make_unique<OpenFile>(*pending_, spec);
    open_file_->write_declarations(meta, spec);
  } catch (const Hdf5Error& error) {
    abandon_file();
    throw scene::InputError(name_ + ": cannot be written: " + error.what());
  } catch (const std::exception&) {
    abandon_file();
    throw;
  }
}

Hdf5Recorder::~Hdf5Recorder() {
  try {
    with_open_file([this](OpenFile& content) {
      content.write_buffered();
      if (content.written_frames > 0) pending_->commit();
    });
  } catch (const std::exception&) {  // a destructor cannot report errors
  }
  if (owner_.is_child()) {
    abandon_file();
    return;
  }
  const std::lock_guard lock(library_mutex());
  open_file_.reset();
}

void Hdf5Recorder::write_frame(const scene::Snapshot& snapshot,
                               const std::vector<scene::ObjectSpec>& catalogue,
                               std::span<const scene::ChannelData> sensors,
                               std::span<const scene::ChannelData> actuators,
                               std::span<const NamedNumber> metrics) {
  with_open_file([&](OpenFile& content) {
    if (catalogue.size() > content.object_count) content.add_objects(catalogue);
    if (!content.series_created) content.create_series(snapshot, sensors, actuators);
    content.buffer_frame(snapshot, sensors, actuators, metrics);
    // Counts from frame 0, so that writes end at chunk boundaries again after an early write.
    if ((content.written_frames + content.buffered_frames) % content.buffer_capacity == 0 ||
        content.heights->buffered_changes() > kMaxBufferedChanges ||
        std::chrono::steady_clock::now() - content.last_write >= kMaxFlushInterval) {
      content.write_buffered();
      pending_->commit();
    }
  });
}

void Hdf5Recorder::record_inputs(std::span<const scene::ChannelData> actuators) {
  with_open_file([&](OpenFile& content) {
    content.append_inputs(actuators);
    // Inputs are recorded every tick, but frames may be far apart.
    if (content.inputs->buffered_changes() > kMaxBufferedChanges) content.write_buffered();
  });
}

void Hdf5Recorder::record_registers(std::span<const scene::ChannelData> registers) {
  with_open_file([&](OpenFile& content) { content.keep_registers(registers); });
}

void Hdf5Recorder::record_live(std::span<const LiveRow> rows) {
  with_open_file([&](OpenFile& content) { content.keep_live(rows); });
}

void Hdf5Recorder::flush() {
  with_open_file([&](OpenFile& content) {
    if (content.buffered_frames == 0) return;
    content.write_buffered();
    pending_->commit();
  });
}

void Hdf5Recorder::mark_user_interaction(std::uint64_t tick) {
  with_open_file([&](OpenFile& content) {
    if (std::exchange(content.interaction_marked, true)) return;
    require_memory(0);
    pending_->require_unchanged();
    content.preallocator.preallocate(kMetadataBytes);
    write_attribute(open_group(content.file, paths::kMeta), paths::kTouchedByHand, tick);
    content.flush();
  });
}

void Hdf5Recorder::close(const RunResult& result) {
  with_open_file([&](OpenFile& content) {
    content.closing = true;
    content.write_buffered();
    if (content.judged_frames == 0 && content.written_frames > 0) content.drop_costly_sensors();
    content.preallocator.preallocate(kMetadataBytes + result.outcome.size() +
                                     kMetricBytes * result.metrics.size());
    write_result(content.file, result);
    content.flush();
    pending_->require_unchanged();
    if (content.written_frames > 0)
      pending_->commit();
    else
      pending_->commit_if_new();
    open_file_.reset();
    check_closed();
  });
}

}  // namespace smartsurf::record
