#include <cmath>
#include <cstdio>
#include <iomanip>
#include <map>
#include <sstream>

#include "smartsurf/record/CatalogueWriter.h"
#include "smartsurf/record/Purity.h"
#include "smartsurf/record/Recording.h"

namespace smartsurf::record {
namespace {

void line(std::ostream& out, const char* field, const std::string& text) {
  if (!text.empty()) out << std::left << std::setw(12) << field << text << '\n';
}

template <class... Parts>
std::string joined(const Parts&... parts) {
  std::ostringstream out;
  out.precision(6);
  (out << ... << parts);
  return out.str();
}

std::string size_text(std::uint64_t bytes) {
  if (bytes < 1000) return joined(bytes, " bytes");
  if (bytes < 1000000) return joined(std::round(static_cast<double>(bytes) / 100.0) / 10.0, " kB");
  return joined(std::round(static_cast<double>(bytes) / 1e5) / 10.0, " MB");
}

std::string hash_text(std::uint64_t hash) {
  char digits[17];
  std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(hash));
  return digits;
}

std::string list(const std::vector<NamedText>& texts, const char* between) {
  std::string all;
  for (const NamedText& text : texts) all += (all.empty() ? "" : ", ") + text.name + between + text.value;
  return all;
}

std::string options(const Recording& recording) {
  std::vector<NamedText> texts;
  for (const scene::OptionSpec& option : recording.spec().options)
    texts.push_back({option.name, option.value});
  return list(texts, " = ");
}

std::string surface(const scene::SurfaceSpec& s) {
  return joined(s.rows, " rows × ", s.columns, " columns, pitch ", s.pitch, " u, pin tops ", s.pin.top_x,
                " × ", s.pin.top_y, " u, heights ", s.pin.min_height, " to ", s.pin.max_height, " u",
                s.border_height ? joined(", border ", *s.border_height, " u") : "");
}

std::string physics(const Recording& recording) {
  const scene::WorldSpec& world = recording.spec().world;
  return joined("dt ", world.dt_s, " s, control period ", world.control_period_s, " s, ",
                recording.meta().mode, " mode");
}

// "40: 20 'large' (sphere, size 4 u), 20 'small' (sphere, size 2 u)"
std::string objects(const std::vector<scene::ObjectSpec>& catalogue) {
  struct Kind {
    std::map<std::string, bool> shapes;
    double least = INFINITY, most = 0.0;
    int count = 0;
  };
  std::map<std::string, Kind> kinds;
  for (const scene::ObjectSpec& object : catalogue) {
    Kind& kind = kinds[object.label];
    kind.shapes[name_of(object.shape)] = true;
    kind.least = std::min(kind.least, size_of(object));
    kind.most = std::max(kind.most, size_of(object));
    ++kind.count;
  }
  std::string all = joined(catalogue.size());
  for (const auto& [label, kind] : kinds) {
    all += (&kind == &kinds.begin()->second ? ": " : ", ") + joined(kind.count, ' ');
    all += label.empty() ? "unlabelled" : "'" + label + "'";
    all += " (";
    for (const auto& [shape, yes] : kind.shapes) all += shape + ", ";
    all += kind.least == kind.most ? joined("size ", kind.least, " u)")
                                   : joined("sizes ", kind.least, " to ", kind.most, " u)");
  }
  return all;
}

std::string frames(const Recording& recording) {
  const std::size_t n = recording.frames();
  if (n == 0) return "0";
  return joined(
      n, ", ticks ", recording.tick().front(), " to ", recording.tick().back(), ", ",
      recording.time().front(), " s to ", recording.time().back(), " s, every ",
      recording.spec().record.every == 1 ? "tick" : joined(recording.spec().record.every, " ticks"));
}

std::string outcome(const Recording& recording) {
  const std::optional<Result>& result = recording.result();
  if (!result) return "none recorded: the run was killed, or is still going on";
  return joined(result->outcome, " after ", result->ticks, " ticks, ", result->simulated_s, " s simulated");
}

std::string state(const Recording& recording) {
  if (recording.result()) return hash_text(recording.result()->state_hash) + " at the end";
  if (recording.frames() == 0) return "";
  return hash_text(recording.hash().back()) + " at the last frame";
}

std::string purity_text(const Recording& recording) {
  if (!recording.has_objects() || recording.frames() == 0) return "";
  try {
    const Purity p = purity(recording);
    return joined(p.value.front(), " at the start, ", p.value.back(), " at the end, ",
                  p.sorted_at ? joined("sorted at ", *p.sorted_at, " s") : "never sorted");
  } catch (const scene::InputError&) {
    return "";  // not an experiment with two classes
  }
}

std::string extents_text(const Recording::Dataset& dataset) {
  std::string text;
  for (const std::uint64_t extent : dataset.extents) text += (text.empty() ? "" : " × ") + joined(extent);
  return text;
}

}  // namespace

std::string info(const Recording& recording) {
  std::ostringstream out;
  line(out, "recording", joined(recording.path().string(), " (", size_text(recording.file_bytes()), ")"));
  line(out, "versions", list(recording.meta().versions, " "));
  line(out, "command", recording.meta().command_line);
  line(out, "experiment", recording.spec().file);
  line(out, "program", recording.meta().program_file);
  line(out, "options", options(recording));
  line(out, "seed", joined(recording.spec().world.seed));
  line(out, "physics", physics(recording));
  line(out, "surface", surface(recording.spec().surface));
  line(out, "objects", objects(recording.spec().objects));
  line(out, "frames", frames(recording));
  line(out, "outcome", outcome(recording));
  line(out, "state hash", state(recording));
  line(out, "purity", purity_text(recording));
  out << "datasets\n";
  for (const Recording::Dataset& dataset : recording.datasets())
    out << "  " << std::left << std::setw(34) << dataset.name << extents_text(dataset) << '\n';
  return out.str();
}

}  // namespace smartsurf::record
