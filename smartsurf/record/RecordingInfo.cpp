#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iomanip>
#include <map>
#include <span>
#include <sstream>

#include "common/text/Printable.h"
#include "common/text/Words.h"
#include "smartsurf/record/Recording.h"
#include "smartsurf/record/TimeText.h"
#include "smartsurf/record/hdf5/CatalogueWriter.h"

namespace smartsurf::record {
namespace {

void write_line(std::ostream& out, const char* field, const std::string& text) {
  if (!text.empty()) out << std::left << std::setw(12) << field << common::printable(text) << '\n';
}

template <class... Parts>
std::string concat(const Parts&... parts) {
  std::ostringstream out;
  out.precision(6);
  (out << ... << parts);
  return out.str();
}

std::string size_text(std::uint64_t bytes) {
  if (bytes < 1000) return concat(bytes, " bytes");
  if (bytes < 1000000) return concat(std::round(static_cast<double>(bytes) / 100.0) / 10.0, " kB");
  return concat(std::round(static_cast<double>(bytes) / 1e5) / 10.0, " MB");
}

std::string hash_text(std::uint64_t hash) {
  char digits[17];
  std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(hash));
  return digits;
}

std::string join_texts(const std::vector<NamedText>& texts, const char* separator) {
  return common::join(texts, [&](const NamedText& text) { return text.name + separator + text.value; });
}

std::string options_text(const Recording& recording) {
  std::vector<NamedText> texts;
  for (const scene::OptionSpec& option : recording.spec().options)
    texts.push_back({option.name, option.value});
  return join_texts(texts, " = ");
}

std::string variations_text(const std::vector<scene::Variation>& all) {
  std::vector<NamedText> texts;
  for (const scene::Variation& v : all)
    texts.push_back({v.name, concat(v.drawn.value_or(NAN), " (", to_text(v), ")")});
  return join_texts(texts, " = ");
}

std::string surface_text(const Recording& recording) {
  const scene::SurfaceSpec& s = recording.spec().surface;
  const std::string models = ", " + recording.actuator_models();
  const bool has_pins = (models + ",").find(", pin,") != std::string::npos;
  return concat(s.rows, " rows × ", s.columns, " columns, pitch ", s.pitch, " u", models,
                has_pins ? concat(", tops ", s.pin.top_x, " × ", s.pin.top_y, " u, heights ",
                                  s.pin.min_height, " to ", s.pin.max_height, " u")
                         : "",
                s.border_height ? concat(", border ", *s.border_height, " u") : "");
}

std::string physics_text(const Recording& recording) {
  const scene::WorldSpec& world = recording.spec().world;
  return concat(
      recording.meta().is_simulated ? concat("engine ", world.engine, ", dt ", world.dt_s, " s, ") : "",
      "control period ", world.control_period_s, " s, ", recording.meta().mode, " mode",
      world.unit ? concat(", 1 u = 1 ", world.unit->name) : "");
}

// A range of lengths: "4", "1 to 2".
struct Extent {
  double min = INFINITY, max = 0.0;
  void add(double value) {
    min = std::min(min, value);
    max = std::max(max, value);
  }
  bool is_one() const { return min == max; }
  std::string text() const { return is_one() ? concat(min) : concat(min, " to ", max); }
};

// "radius 4 u", "sizes 1 to 2 × 5 × 1 u"; empty if there is no length.
std::string lengths_text(std::span<const Extent> extents, const char* singular, const char* plural) {
  std::string text;
  for (const Extent& extent : extents) {
    if (extent.min > extent.max) return "";
    text += (text.empty() ? "" : " × ") + extent.text();
  }
  return concat(std::ranges::all_of(extents, &Extent::is_one) ? singular : plural, ' ', text, " u");
}

// The mean of the horizontal edges of the bounding box, u.
double mean_width(const scene::Solid& solid) {
  const Eigen::Vector3f edges = solid.bounds_max - solid.bounds_min;
  return static_cast<double>(edges.x() + edges.y()) / 2.0;
}

// "40: 20 'large' (sphere, radius 4 u), 20 'small' (box, size 1 × 5 × 1 u)". Solids have a width.
std::string objects_text(const std::vector<scene::ObjectSpec>& catalogue) {
  struct LabelGroup {
    std::map<std::string, bool> shapes;
    std::array<Extent, 1> radius, width;
    std::array<Extent, 3> size;
    int count = 0;
  };
  std::map<std::string, LabelGroup> kinds;
  for (const scene::ObjectSpec& object : catalogue) {
    LabelGroup& kind = kinds[object.label];
    kind.shapes[shape_name(object.shape)] = true;
    if (object.shape == scene::ShapeKind::kSolid)
      kind.width[0].add(mean_width(*object.solid));
    else if (object.shape != scene::ShapeKind::kBox)
      kind.radius[0].add(object.radius);
    else
      for (int axis = 0; axis < 3; ++axis) kind.size[axis].add(object.size[axis]);
    ++kind.count;
  }
  std::string all = concat(catalogue.size());
  for (const auto& [label, kind] : kinds) {
    all += (&kind == &kinds.begin()->second ? ": " : ", ") + concat(kind.count, ' ');
    all += label.empty() ? "unlabelled" : "'" + label + "'";
    all += " (";
    std::vector<std::string> facts;
    for (const auto& [shape, yes] : kind.shapes) facts.push_back(shape);
    for (const std::string& lengths :
         {lengths_text(kind.radius, "radius", "radii"), lengths_text(kind.size, "size", "sizes"),
          lengths_text(kind.width, "width", "widths")})
      if (!lengths.empty()) facts.push_back(lengths);
    all += common::join(facts) + ")";
  }
  return all;
}

// To the hundredth of a second, as `smartsurf run` prints times.
double rounded(double time_s) { return std::round(100.0 * time_s) / 100.0; }

// A recorder of a live surface may miss frames.
std::string frames_text(const Recording& recording) {
  const std::uint64_t n = recording.frames(), interval = recording.spec().record.tick_interval;
  if (n == 0) return "0";
  const std::uint64_t first = recording.ticks().front(), last = recording.ticks().back();
  const std::uint64_t due = last < first ? 0 : (last - first) / interval + 1;
  return concat(n, ", ticks ", first, " to ", last, ", ", rounded(recording.times().front()), " s to ",
                rounded(recording.times().back()), " s, every ",
                interval == 1 ? "tick" : concat(interval, " ticks"),
                due > n ? concat(", ", due - n, " missing") : "");
}

std::string sensors_text(const Recording& recording) {
  const std::string names = common::join(recording.channel_names(ChannelGroup::kSensors));
  return names.empty() ? "none recorded" : names;
}

std::string outcome_text(const Recording& recording) {
  const std::optional<RunResult>& result = recording.result();
  if (!result) return "none recorded: the run was killed or is still running";
  return concat(result->outcome, " after ", result->ticks, " ticks, ", rounded(result->simulated_s),
                " s simulated");
}

std::string state_text(const Recording& recording) {
  if (recording.result() && recording.result()->state_hash)
    return hash_text(*recording.result()->state_hash) + " at the end";
  if (recording.frames() == 0 || !recording.meta().is_simulated) return "";
  return hash_text(recording.state_hashes().back()) + " at the last frame";
}

// A line for each metric, by name: its first value and its last one, that of on_finish.
void write_metrics(std::ostream& out, const Recording& recording) {
  std::map<std::string, std::vector<std::string>> facts;
  std::map<std::string, double> at_end;
  if (recording.result()) at_end = {recording.result()->metrics.begin(), recording.result()->metrics.end()};
  for (const std::string& name : recording.metric_names()) {
    std::vector<double> values = recording.read_metric(name);
    std::erase_if(values, [](double value) { return !std::isfinite(value); });
    if (values.empty()) continue;
    facts[name] = {concat(values.front(), " at the start")};
    if (!at_end.contains(name)) facts[name].push_back(concat(values.back(), " at the last frame"));
  }
  for (const auto& [name, value] : at_end)
    if (std::isfinite(value))
      facts[name].push_back(concat(value, " at the end"));
    else if (facts.contains(name))
      facts[name].emplace_back("none at the end");
  for (const auto& [name, texts] : facts) write_line(out, "metric", name + ": " + common::join(texts));
}

std::string success_text(const Recording& recording) {
  if (!recording.success()) return "";
  if (const auto time_s = recording.success_s()) return "at " + time_text(*time_s) + " s";
  return *recording.success() ? "yes" : "no";
}

std::string extents_text(const Recording::DatasetInfo& dataset) {
  std::string text;
  for (const std::uint64_t extent : dataset.extents) text += (text.empty() ? "" : " × ") + concat(extent);
  return text;
}

}  // namespace

std::string describe_recording(const Recording& recording) {
  std::ostringstream out;
  write_line(out, "recording",
             concat(recording.path().string(), " (", size_text(recording.file_bytes()), ")"));
  write_line(out, "versions", join_texts(recording.meta().versions, " "));
  if (!recording.meta().extensions.empty())
    write_line(out, "extensions", join_texts(recording.meta().extensions, " "));
  write_line(out, "command", recording.meta().command_line);
  write_line(out, "experiment", recording.spec().file);
  write_line(out, "program", recording.meta().program_file);
  write_line(out, "options", options_text(recording));
  if (!recording.meta().varied.empty()) write_line(out, "varied", variations_text(recording.meta().varied));
  if (recording.meta().is_simulated) write_line(out, "seed", concat(recording.spec().world.seed));
  write_line(out, "physics", physics_text(recording));
  write_line(out, "surface", surface_text(recording));
  if (!recording.spec().objects.empty()) write_line(out, "objects", objects_text(recording.spec().objects));
  write_line(out, "sensors", sensors_text(recording));
  write_line(out, "frames", frames_text(recording));
  write_line(out, "outcome", outcome_text(recording));
  write_line(out, "state hash", state_text(recording));
  write_metrics(out, recording);
  write_line(out, "success", success_text(recording));
  return out.str();
}

std::string list_datasets(const Recording& recording) {
  std::ostringstream out;
  for (const Recording::DatasetInfo& dataset : recording.datasets())
    out << std::left << std::setw(36) << common::printable(dataset.name) << extents_text(dataset) << '\n';
  return out.str();
}

}  // namespace smartsurf::record
