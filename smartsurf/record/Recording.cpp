#include "smartsurf/record/Recording.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "smartsurf/record/hdf5/AttributeArchive.h"
#include "smartsurf/record/hdf5/CatalogueReader.h"
#include "smartsurf/record/hdf5/DeltaEncoding.h"
#include "smartsurf/record/hdf5/ForkedRead.h"
#include "smartsurf/record/hdf5/Hdf5Meta.h"
#include "smartsurf/record/hdf5/Hdf5Reading.h"
#include "smartsurf/record/hdf5/Names.h"
#include "smartsurf/record/hdf5/Structure.h"
#include "smartsurf/record/hdf5/SurfaceLayout.h"

namespace smartsurf::record {
namespace {

namespace fs = std::filesystem;

constexpr auto kNoTick = std::numeric_limits<std::uint64_t>::max();
constexpr hsize_t kMaxCellsPerFrame = hsize_t{1} << 28;  // per channel: 1 GiB; more is implausible

}  // namespace

struct Recording::Contents {
  explicit Contents(const fs::path& file_path) : path(file_path), file(open_for_reading(file_path)) {
    std::error_code error;
    bytes = fs::file_size(path, error);
    for (const StoredDataset& found : list_structure(file))
      datasets.push_back({found.name, {found.extents.begin(), found.extents.end()}});
    RecordedMeta recorded = read_meta(file, spec);
    meta = std::move(recorded.meta);
    result = std::move(recorded.result);
    first_interaction_tick = recorded.first_interaction_tick;
    actuator_models = read_surface(file, spec.surface);
    read_frames();
    read_catalogue(file, spec);
    open_delta_readers();
  }

  void read_frames();
  void open_delta_readers();
  void keep_frames(std::size_t most);
  template <class Action>
  auto translate_errors(Action action) const {
    try {
      return action();
    } catch (const Hdf5Error& error) {
      throw scene::InputError(path.string() + ": " + error.what());
    }
  }
  std::vector<float> read_poses(const char* name, hsize_t width, std::size_t first, std::size_t count) const;
  std::vector<float> read_vectors(const char* name, std::size_t first, std::size_t count) const;
  std::vector<float> read_channel_frame(const std::string& name, std::size_t frame) const;

  fs::path path;
  Handle file;
  std::uint64_t bytes = 0;
  scene::SceneSpec spec;
  RunMetadata meta;
  std::string actuator_models;
  std::optional<RunResult> result;
  std::vector<DatasetInfo> datasets;
  std::vector<std::uint64_t> ticks, state_hashes;
  std::vector<std::uint32_t> contact_counts;
  std::vector<double> times;
  bool has_objects = false, has_angular_velocities = false;
  std::optional<std::uint64_t> first_interaction_tick;
  std::optional<DeltaReader> inputs, heights, motion, skin;
};

// A run killed during a flush may leave datasets of different lengths, or a tail of fill values; frames() is
// the length of the part that all datasets have.
void Recording::Contents::read_frames() {
  if (!has_link(file, paths::kTick)) return;  // the run ended before its first frame
  hsize_t frames = H5S_UNLIMITED;
  const auto bound = [&](const char* name, std::size_t entry_bytes) {
    frames = std::min(frames, stored_entries(open_dataset(file, name, 1), entry_bytes));
  };
  bound(paths::kTick, sizeof(std::uint64_t));
  bound(paths::kTime, sizeof(double));
  bound(paths::kHash, sizeof(std::uint64_t));
  bound(paths::kContacts, sizeof(std::uint32_t));
  has_objects = has_link(file, paths::kObjects) && has_link(file, paths::kPosition);
  has_angular_velocities = has_objects && has_link(file, paths::kAngularVelocity);
  const auto bound_poses = [&](const char* name) {
    frames = std::min(frames, extents(open_dataset(file, name, 3)).at(0));
  };
  if (has_objects)
    for (const char* name : {paths::kPosition, paths::kOrientation, paths::kVelocity}) bound_poses(name);
  if (has_angular_velocities) bound_poses(paths::kAngularVelocity);
  ticks = read_column<std::uint64_t>(file, paths::kTick, frames);
  ticks.erase(std::find(ticks.begin(), ticks.end(), kNoTick), ticks.end());
  times = read_column<double>(file, paths::kTime, ticks.size());
  state_hashes = read_column<std::uint64_t>(file, paths::kHash, ticks.size());
  contact_counts = read_column<std::uint32_t>(file, paths::kContacts, ticks.size());
  for (std::size_t i = 0; i < times.size(); ++i)
    if (!std::isfinite(times[i]) || (i > 0 && !(times[i] > times[i - 1])))
      throw Hdf5Error("dataset time is not ascending at frame " + std::to_string(i));
}

void Recording::Contents::open_delta_readers() {
  const std::size_t cells = spec.surface.cell_count();
  if (has_link(file, paths::kInputs)) {
    std::uint64_t values = 0;
    AttributeReader(open_group(file, paths::kInputs))(paths::kInputValues, values);
    if (values > kMaxCellsPerFrame) throw Hdf5Error("there are too many inputs");
    inputs.emplace(file, paths::kInputChanges, values);
  }
  if (has_link(file, paths::kHeightChanges)) heights.emplace(file, paths::kHeightChanges, cells);
  if (has_link(file, paths::kMotion)) motion.emplace(file, paths::kMotion, kValuesPerActuatorState * cells);
  if (const auto& grid = spec.surface.skin; grid && has_link(file, paths::kSkinHeight))
    skin.emplace(file, paths::kSkinHeight,
                 static_cast<std::size_t>(grid->rows) * static_cast<std::size_t>(grid->columns));
  for (const auto* const rows : {&heights, &motion, &skin})
    if (*rows) keep_frames((*rows)->rows());
}

// A frame exists where all of it does.
void Recording::Contents::keep_frames(std::size_t most) {
  if (ticks.size() <= most) return;
  ticks.resize(most);
  times.resize(most);
  state_hashes.resize(most);
  contact_counts.resize(most);
}

// Objects beyond the pose arrays' second axis were created after the last stored frame; they are padded with
// NaN, which stands for "does not exist".
std::vector<float> Recording::Contents::read_poses(const char* name, hsize_t width, std::size_t first,
                                                   std::size_t count) const {
  const Handle dataset = open_dataset(file, name, 3);
  const std::vector<hsize_t> stored = extents(dataset);
  if (stored[2] != width) throw Hdf5Error(std::string("dataset ") + name + " has the wrong width");
  const hsize_t objects = spec.objects.size(), columns = std::min(stored[1], objects);
  const std::vector<float> block = read_block<float>(dataset, {first, 0, 0}, {count, columns, width}, name);
  if (columns == objects) return block;
  std::vector<float> padded(count * objects * width, std::numeric_limits<float>::quiet_NaN());
  for (std::size_t f = 0; f < count; ++f)
    std::copy_n(block.begin() + f * columns * width, columns * width, padded.begin() + f * objects * width);
  return padded;
}

std::string why_no_objects(const RunMetadata& meta) {
  return std::string("has no object poses: ") +
         (meta.is_simulated ? "its experiment sets record { objects = false }"
                            : "it is the recording of a live surface, which has no objects");
}

std::vector<float> Recording::Contents::read_vectors(const char* name, std::size_t first,
                                                     std::size_t count) const {
  return translate_errors([&] {
    if (!has_objects) throw Hdf5Error(why_no_objects(meta));
    return read_poses(name, 3, first, count);
  });
}

std::vector<float> Recording::Contents::read_channel_frame(const std::string& name, std::size_t frame) const {
  const Handle dataset = open_dataset(file, name);
  std::vector<hsize_t> size = extents(dataset), start(size.size(), 0);
  if (size.size() < 3 || size.size() > 4 || frame >= size[0])
    throw Hdf5Error("dataset " + name + " has no frame " + std::to_string(frame));
  hsize_t cells = 1;
  for (std::size_t axis = 1; axis < size.size(); ++axis) {
    if (size[axis] > kMaxCellsPerFrame / cells) throw Hdf5Error("dataset " + name + " is too large");
    cells *= size[axis];
  }
  size[0] = 1;
  start[0] = frame;
  return read_block<float>(dataset, start, size, name);
}

Recording::Recording(std::unique_ptr<Contents> contents) : contents_(std::move(contents)) {}
Recording::Recording(Recording&&) noexcept = default;
Recording& Recording::operator=(Recording&&) noexcept = default;
Recording::~Recording() = default;

std::size_t memory_to_read(const fs::path& path) {
  constexpr std::size_t kBytes = std::size_t{2} << 30, kTimesFile = 16;
  std::error_code error;
  const std::uintmax_t file_bytes = fs::file_size(path, error);
  return kBytes + (error ? 0 : kTimesFile * file_bytes);
}

double time_to_read_s(const fs::path& path) {
  constexpr double kMinTime_s = 60.0, kOfByte_s = 1.0 / (1 << 20);
  std::error_code error;
  const std::uintmax_t file_bytes = fs::file_size(path, error);
  return kMinTime_s + (error ? 0.0 : kOfByte_s * static_cast<double>(file_bytes));
}

Recording Recording::open(const fs::path& path) {
  const auto read_first_and_last = [&] {
    const Recording recording = open_here(path);
    if (recording.frames() == 0) return;
    recording.read_snapshot(0);
    recording.read_snapshot(recording.frames() - 1);
  };
  if (const std::string refusal = refusal_of_child(path, memory_to_read(path), read_first_and_last);
      !refusal.empty())
    throw scene::InputError(path.string() + ": " + refusal);
  return open_here(path);
}

Recording Recording::open_here(const fs::path& path) {
  try {
    return Recording(std::make_unique<Contents>(path));
  } catch (const Hdf5Error& error) {
    throw scene::InputError(path.string() + ": " + error.what());
  }
}

const fs::path& Recording::path() const { return contents_->path; }
std::uint64_t Recording::file_bytes() const { return contents_->bytes; }
const scene::SceneSpec& Recording::spec() const { return contents_->spec; }
const RunMetadata& Recording::meta() const { return contents_->meta; }
const std::string& Recording::actuator_models() const { return contents_->actuator_models; }
const std::optional<RunResult>& Recording::result() const { return contents_->result; }
const std::vector<Recording::DatasetInfo>& Recording::datasets() const { return contents_->datasets; }
const std::vector<std::uint64_t>& Recording::ticks() const { return contents_->ticks; }
const std::vector<double>& Recording::times() const { return contents_->times; }
const std::vector<std::uint64_t>& Recording::state_hashes() const { return contents_->state_hashes; }
std::optional<std::uint64_t> Recording::first_interaction_tick() const {
  return contents_->first_interaction_tick;
}
bool Recording::has_heights() const { return contents_->heights.has_value(); }
bool Recording::has_motion() const { return contents_->motion.has_value(); }
bool Recording::has_angular_velocities() const { return contents_->has_angular_velocities; }
bool Recording::has_objects() const { return contents_->has_objects; }
void Recording::require_poses() const {
  if (frames() == 0 || !(has_objects() || has_heights()))
    throw scene::InputError(path().string() + ": holds nothing to show");
}

std::vector<float> Recording::read_positions(std::size_t first, std::size_t count) const {
  return contents_->read_vectors(paths::kPosition, first, count);
}
std::vector<float> Recording::read_velocities(std::size_t first, std::size_t count) const {
  return contents_->read_vectors(paths::kVelocity, first, count);
}
std::vector<float> Recording::read_angular_velocities(std::size_t first, std::size_t count) const {
  return contents_->read_vectors(paths::kAngularVelocity, first, count);
}
const std::vector<std::uint32_t>& Recording::contact_counts() const { return contents_->contact_counts; }

std::span<const float> Recording::read_heights(std::size_t frame) const {
  return contents_->translate_errors([&] { return contents_->heights->read_row(frame); });
}

scene::Snapshot Recording::read_snapshot(std::size_t frame) const {
  scene::Snapshot shot;
  shot.tick = ticks().at(frame);
  shot.time_s = times()[frame];
  shot.state_hash = state_hashes()[frame];
  shot.contact_count = contents_->contact_counts[frame];
  contents_->translate_errors([&] {
    if (contents_->heights) {
      const std::span<const float> heights = contents_->heights->read_row(frame);
      shot.height.assign(heights.begin(), heights.end());
    } else {
      shot.height.assign(spec().surface.cell_count(), static_cast<float>(spec().surface.pin.min_height));
    }
    if (contents_->motion) shot.actuator_state = unflatten_actuator_state(contents_->motion->read_row(frame));
    if (contents_->skin) {
      const std::span<const float> heights = contents_->skin->read_row(frame);
      shot.skin_height.assign(heights.begin(), heights.end());
    }
    if (!has_objects()) return;
    const auto p = contents_->read_poses(paths::kPosition, 3, frame, 1),
               q = contents_->read_poses(paths::kOrientation, 4, frame, 1),
               v = contents_->read_poses(paths::kVelocity, 3, frame, 1),
               w = has_angular_velocities()
                       ? contents_->read_poses(paths::kAngularVelocity, 3, frame, 1)
                       : std::vector<float>(v.size(), std::numeric_limits<float>::quiet_NaN());
    for (std::size_t i = 0; i < spec().objects.size(); ++i) {
      if (std::isnan(p[3 * i])) continue;
      shot.id.push_back(static_cast<scene::ObjectId>(i));
      shot.position.push_back({p[3 * i], p[3 * i + 1], p[3 * i + 2]});
      shot.orientation.push_back({q[4 * i], q[4 * i + 1], q[4 * i + 2], q[4 * i + 3]});
      shot.velocity.push_back({v[3 * i], v[3 * i + 1], v[3 * i + 2]});
      shot.angular_velocity.push_back({w[3 * i], w[3 * i + 1], w[3 * i + 2]});
    }
  });
  return shot;
}

std::size_t Recording::input_tick_count() const { return contents_->inputs ? contents_->inputs->rows() : 0; }

std::span<const float> Recording::read_inputs(std::size_t tick) const {
  return contents_->translate_errors([&] { return contents_->inputs->read_row(tick); });
}

std::string to_string(ChannelGroup group) {
  switch (group) {
    case ChannelGroup::kSensors:
      return paths::kSensors;
    case ChannelGroup::kActuators:
      return paths::kActuators;
    case ChannelGroup::kRegisters:
      return paths::kRegisters;
  }
  return "";
}

std::vector<std::string> Recording::channel_names(ChannelGroup group) const {
  const std::string folder = "/" + to_string(group) + "/";
  std::vector<std::string> names;
  for (const DatasetInfo& dataset : datasets())
    if (dataset.name.starts_with(folder) && dataset.extents.size() >= 3)
      names.push_back(dataset.name.substr(folder.size()));
  return names;
}

std::vector<float> Recording::read_channel(ChannelGroup group, const std::string& name,
                                           std::size_t frame) const {
  return contents_->translate_errors(
      [&] { return contents_->read_channel_frame(to_string(group) + "/" + name, frame); });
}

Recording::ChannelInfo Recording::channel_info(ChannelGroup group, const std::string& name) const {
  return contents_->translate_errors([&] {
    const Handle dataset = open_dataset(contents_->file, to_string(group) + "/" + name);
    ChannelInfo info;
    archive_channel(AttributeReader(dataset), info);
    return info;
  });
}

std::vector<std::string> Recording::metric_names() const {
  const std::string group = std::string("/") + paths::kMetrics + "/";
  std::vector<std::string> names;
  for (const DatasetInfo& dataset : datasets())
    if (dataset.name.starts_with(group) && dataset.extents.size() == 1)
      names.push_back(name_of_link(std::string_view(dataset.name).substr(group.size())));
  return names;
}

std::optional<bool> Recording::success() const { return result() ? result()->success : std::nullopt; }

std::optional<double> Recording::success_s() const { return result() ? result()->success_s : std::nullopt; }

// A metric that began after the last flush of a killed run has no stored values.
std::vector<double> Recording::read_metric(const std::string& name) const {
  return contents_->translate_errors([&] {
    const std::string dataset = std::string(paths::kMetrics) + "/" + link_name(name);
    const hsize_t stored = extents(open_dataset(contents_->file, dataset, 1))[0];
    std::vector<double> values =
        read_column<double>(contents_->file, dataset, std::min<hsize_t>(stored, frames()));
    values.resize(frames(), std::numeric_limits<double>::quiet_NaN());
    return values;
  });
}

std::size_t Recording::channel_components(ChannelGroup group, const std::string& name) const {
  const auto channel = std::ranges::find(datasets(), "/" + to_string(group) + "/" + name, &DatasetInfo::name);
  return channel != datasets().end() && channel->extents.size() == 4 ? channel->extents[3] : 1;
}

std::vector<float> Recording::read_cell_history(ChannelGroup group, const std::string& name, int row,
                                                int column) const {
  return contents_->translate_errors([&] {
    const std::string full_name = to_string(group) + "/" + name;
    const Handle dataset = open_dataset(contents_->file, full_name);
    const std::vector<hsize_t> stored = extents(dataset);
    std::vector<hsize_t> start = {0, static_cast<hsize_t>(row), static_cast<hsize_t>(column)},
                         size = {frames(), 1, 1};
    start.resize(stored.size());
    size.insert(size.end(), stored.begin() + 3, stored.end());
    return read_block<float>(dataset, start, size, full_name);
  });
}

}  // namespace smartsurf::record
