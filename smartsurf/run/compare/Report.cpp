#include "smartsurf/run/compare/Report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/csv/Csv.h"
#include "common/files/AtomicFile.h"
#include "smartsurf/record/plot/Plot.h"

namespace smartsurf::run {
namespace {

constexpr const char *kDistances = "distances.svg", *kLoads = "loads.svg", *kHeights = "heights.svg",
                     *kTable = "objects.csv";

constexpr std::size_t kMaxCurves = 7;

// "12.3 and 12.4 (+0.8 %)"
std::string pair_text(double first, double second) {
  const std::string both = fmt::format("{:.5g} and {:.5g}", first, second);
  if (first == second) return both;
  return first == 0.0 ? both
                      : fmt::format("{} ({:+.2g} %)", both, 100.0 * (second - first) / std::abs(first));
}

std::string verdict_text(const Verdict& v, double tolerance) {
  const std::string parting =
      v.parts_s ? fmt::format("within {:g} u until {:.3f} s, at the end {:.3g} u apart", tolerance,
                              *v.parts_s, v.final_distance)
                : fmt::format("within {:g} u to the end, {:.2g} u at most", tolerance, v.greatest_distance);
  return fmt::format("  object {} ({}, {:.3g} u): {}; contact load {}\n", v.id, v.name, v.size, parting,
                     pair_text(v.load[0], v.load[1]));
}

// Earliest divergence first, then the farthest apart.
std::vector<Verdict> sorted_by_parting(std::vector<Verdict> verdicts) {
  std::ranges::stable_sort(verdicts, [](const Verdict& a, const Verdict& b) {
    const double at_a = a.parts_s.value_or(HUGE_VAL), at_b = b.parts_s.value_or(HUGE_VAL);
    return at_a != at_b ? at_a < at_b : a.greatest_distance > b.greatest_distance;
  });
  return verdicts;
}

std::string metrics_text(const EngineTrace& first, const EngineTrace& second) {
  std::string text;
  for (const auto& [name, value] : first.metrics) {
    const auto same = std::ranges::find(second.metrics, name, &scene::Metric::first);
    text += same == second.metrics.end()
                ? fmt::format("  metric {}: {:.5g}, and none with {}\n", name, value, second.engine)
                : fmt::format("  metric {}: {}\n", name, pair_text(value, same->second));
  }
  for (const auto& [name, value] : second.metrics)
    if (std::ranges::find(first.metrics, name, &scene::Metric::first) == first.metrics.end())
      text += fmt::format("  metric {}: none with {}, and {:.5g}\n", name, first.engine, value);
  return text;
}

void write_file(const std::filesystem::path& path, const std::string& text) {
  if (const std::error_code error = common::replace_file(path, text))
    throw scene::InputError(path.string() + ": cannot be written: " + error.message());
}

std::string table(const Comparison& comparison, const EngineTrace& first, const EngineTrace& second) {
  std::string text =
      fmt::format("id,name,size_u,parts_s,greatest_distance_u,final_distance_u,load_{},load_{}\n",
                  first.engine, second.engine);
  for (const Verdict& v : comparison.verdicts) {
    text += fmt::format("{},", v.id);
    common::append_csv_field(text, v.name);
    text += fmt::format(",{:.6g},{},{:.6g},{:.6g},{:.6g},{:.6g}\n", v.size,
                        v.parts_s ? fmt::format("{:.6g}", *v.parts_s) : "", v.greatest_distance,
                        v.final_distance, v.load[0], v.load[1]);
  }
  return text;
}

// The sum over all objects, one value per tick.
std::vector<double> total_load(const EngineTrace& trace) {
  std::vector<double> total(trace.time_s.size(), 0.0);
  for (const ObjectTrace& object : trace.objects)
    for (std::size_t t = 0; t < object.load.size(); ++t) total[t] += static_cast<double>(object.load[t]);
  return total;
}

std::vector<double> mean_height(const EngineTrace& trace) {
  std::vector<double> mean(trace.time_s.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t t = 0; t < mean.size(); ++t) {
    double sum = 0.0;
    int count = 0;
    for (const ObjectTrace& object : trace.objects)
      if (object.position[t].allFinite()) sum += static_cast<double>(object.position[t].z()), ++count;
    if (count > 0) mean[t] = sum / count;
  }
  return mean;
}

}  // namespace

std::string describe(const Comparison& comparison, const EngineTrace& first, const EngineTrace& second) {
  std::size_t together = 0;
  for (const Verdict& v : comparison.verdicts) together += v.parts_s ? 0 : 1;
  std::string text = fmt::format("{} ({}) and {} ({}): {} of {} objects stay within {:g} u for {:.3f} s\n",
                                 first.engine, first.version, second.engine, second.version, together,
                                 comparison.verdicts.size(), comparison.tolerance, comparison.end_s);
  if (first.time_s.back() != second.time_s.back())
    text += fmt::format("  {} ended at {:.3f} s, {} at {:.3f} s\n", first.engine, first.time_s.back(),
                        second.engine, second.time_s.back());
  if (first.objects.size() != second.objects.size())
    text += fmt::format("  {} had {} objects, {} had {}\n", first.engine, first.objects.size(), second.engine,
                        second.objects.size());
  const std::vector<Verdict> sorted = sorted_by_parting(comparison.verdicts);
  for (std::size_t i = 0; i < std::min(sorted.size(), kMaxReportedObjects); ++i)
    text += verdict_text(sorted[i], comparison.tolerance);
  if (sorted.size() > kMaxReportedObjects)
    text += fmt::format("  … and {} more; --out FOLDER writes all to objects.csv\n",
                        sorted.size() - kMaxReportedObjects);
  return text + metrics_text(first, second);
}

std::vector<common::NamedOutput> report_files(const std::filesystem::path& folder) {
  std::vector<common::NamedOutput> files;
  for (const char* name : {kDistances, kLoads, kHeights, kTable}) files.push_back({"--out", folder / name});
  return files;
}

void write_report(const Comparison& comparison, const EngineTrace& first, const EngineTrace& second,
                  const std::string& experiment, const std::filesystem::path& folder) {
  const std::size_t ticks = std::min(first.time_s.size(), second.time_s.size());
  const std::vector<double> time(first.time_s.begin(), first.time_s.begin() + ticks);
  const std::string subtitle = fmt::format(
      "{} · {} and {}", std::filesystem::path(experiment).filename().string(), first.engine, second.engine);
  record::TimeSeries apart{"Distance between the engines", "distance [u]", {}};
  const std::vector<Verdict> sorted = sorted_by_parting(comparison.verdicts);
  for (std::size_t i = 0; i < std::min(sorted.size(), kMaxCurves); ++i)
    apart.curves.push_back({fmt::format("object {} ({})", sorted[i].id, sorted[i].name),
                            distances(first, second, sorted[i].id)});
  record::write_curves(time, std::move(apart), subtitle, folder / kDistances);
  record::write_curves(time,
                       {"Contact load of all objects",
                        "load [mass·u/s²]",
                        {{first.engine, total_load(first)}, {second.engine, total_load(second)}}},
                       subtitle, folder / kLoads);
  record::write_curves(time,
                       {"Mean height of the objects",
                        "height [u]",
                        {{first.engine, mean_height(first)}, {second.engine, mean_height(second)}}},
                       subtitle, folder / kHeights);
  write_file(folder / kTable, table(comparison, first, second));
}

}  // namespace smartsurf::run
