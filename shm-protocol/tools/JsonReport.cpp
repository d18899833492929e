#include <cmath>
#include <nlohmann/json.hpp>

#include "Report.h"

namespace shm_protocol::dump {
namespace {

using Json = nlohmann::ordered_json;

std::string hex(std::uint64_t word) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(word));
  return text;
}

std::string dumped(const Json& json, bool compact) {
  return json.dump(compact ? -1 : 2, ' ', false, Json::error_handler_t::replace) + "\n";
}

Json counters_json(const Counters& c) {
  return {{"skipped", c.skipped},
          {"repeated", c.repeated},
          {"clamped", c.clamped},
          {"deadline_misses", c.deadline_misses}};
}

Json frame_json(const FrameInfo& f, bool torn) {
  return {{"frame", f.frame},     {"tick", f.tick},     {"time_s", f.time_s},
          {"answers", f.answers}, {"status", f.status}, {"newest_was_torn", torn}};
}

// Non-finite values become null, because JSON cannot represent them.
Json number(double v) { return std::isfinite(v) ? Json(v) : Json(nullptr); }

Json channel_json(const ChannelSpec& c, const Description& d) {
  return {{"name", c.name},         {"direction", text(c.direction)},
          {"dtype", text(c.dtype)}, {"shape", {c.components, d.rows, d.columns}},
          {"unit", c.unit},         {"minimum", c.minimum},
          {"maximum", c.maximum},   {"safe", c.safe}};
}

Json segment_json(const SegmentInfo& s) {
  const char* names[] = {"living", "orphan", "foreign"};
  return {{"name", s.name},
          {"ownership", names[static_cast<int>(s.ownership)]},
          {"bytes", s.bytes},
          {"version", std::to_string(s.version_major) + "." + std::to_string(s.version_minor)},
          {"surface_pid", s.surface_pid},
          {"controller_pid", s.controller_pid},
          {"user", s.user}};
}

}  // namespace

std::string json_report(const SurfaceStatus& status, const ObserverEndpoint& observer, const Format& format,
                        bool compact) {
  const Description& d = *status.description;
  Json out{{"name", d.name},
           {"version", std::to_string(d.version_major) + "." + std::to_string(d.version_minor)},
           {"session", hex(d.session)},
           {"layout_hash", hex(d.layout_hash)},
           {"rows", d.rows},
           {"columns", d.columns},
           {"pitch", d.pitch},
           {"period_ns", d.period_ns},
           {"mode", text(d.mode)},
           {"controllers_seen", status.controllers_seen}};
  out["surface"] = {{"pid", d.surface_pid},
                    {"state", text(status.surface)},
                    {"counters", counters_json(status.surface_counters)},
                    {"frame", frame_json(status.sensors, status.sensors_torn)}};
  out["controller"] = {{"pid", status.controller_pid},
                       {"state", text(status.controller)},
                       {"counters", counters_json(status.controller_counters)},
                       {"frame", frame_json(status.actuators, status.actuators_torn)}};
  if (status.rates) {
    out["surface"]["frames_per_s"] = status.rates->sensors_hz;
    out["controller"]["frames_per_s"] = status.rates->actuators_hz;
  }
  Json channels = Json::array();
  for (int i = 0; i < std::ssize(d.channels); ++i) {
    const ChannelSpec& c = d.channels[i];
    Json channel = channel_json(c, d);
    if (status.frame(c.direction).frame != 0) {
      const std::vector<double> numbers = values(observer, i);
      const ValueStatistics s = value_statistics(numbers);
      channel["now"] = {
          {"smallest", s.minimum}, {"mean", s.mean}, {"largest", s.maximum}, {"not_finite", s.non_finite}};
      if (format.arrays != ArrayDisplay::kNone && is_wanted(format, c)) {
        Json array = Json::array();
        for (const double v : numbers) array.push_back(number(v));
        channel["values"] = std::move(array);
      }
    }
    channels.push_back(std::move(channel));
  }
  out["channels"] = std::move(channels);
  return dumped(out, compact);
}

std::string json_list(const std::vector<SegmentInfo>& segments) {
  Json out = Json::array();
  for (const SegmentInfo& s : segments) out.push_back(segment_json(s));
  return dumped(out, false);
}

}  // namespace shm_protocol::dump
