#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>

#include "HeatMap.h"
#include "Report.h"
#include "common/text/Printable.h"

namespace shm_protocol::dump {
namespace {

__attribute__((format(printf, 1, 2))) std::string line(const char* format, ...) {
  char text[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return text;
}

// "64 x 64" or "3 x 64 x 64": components only if there are several.
std::string shape_text(const ChannelSpec& c, const Description& d) {
  return (c.components > 1 ? line("%u x ", c.components) : "") + line("%u x %u", d.rows, d.columns);
}

// 1536 → "1.5 KiB"
std::string size_text(std::uint64_t bytes) {
  const auto n = static_cast<double>(bytes);
  if (bytes < 1024) return line("%.0f B", n);
  if (bytes < 1024 * 1024) return line("%.1f KiB", n / 1024);
  if (bytes < 1024 * 1024 * 1024) return line("%.1f MiB", n / 1048576);
  return line("%.1f GiB", n / 1073741824);
}

std::string range_text(const ChannelSpec& c) { return line("%.4g … %.4g", c.minimum, c.maximum); }

// Pads to `width` characters; printf counts bytes, and "…" has three.
std::string padded(std::string text, std::size_t width) {
  const std::size_t characters = std::ranges::count_if(text, [](char c) { return (c & 0xC0) != 0x80; });
  if (characters < width) text.append(width - characters, ' ');
  return text;
}

std::string side_line(const char* who, std::uint32_t pid, State state, const FrameInfo& frame, bool torn) {
  std::string out = line("%-11s", who);
  if (pid == 0) return out + "none attached\n";
  out += line("pid %-8u %-8s", pid, text(state));
  if (frame.frame == 0) return out + " no frame yet\n";
  out += line(" frame %-9llu tick %-9llu %.3f s", static_cast<unsigned long long>(frame.frame),
              static_cast<unsigned long long>(frame.tick), frame.time_s);
  return out + (torn ? "\n           (the newest one was overwritten during each try to copy it)\n" : "\n");
}

std::string counter_line(const char* who, const Counters& c, const std::optional<double>& hz) {
  std::string out =
      line("%-11s%12llu%12llu%12llu%12llu", who, static_cast<unsigned long long>(c.skipped),
           static_cast<unsigned long long>(c.repeated), static_cast<unsigned long long>(c.clamped),
           static_cast<unsigned long long>(c.deadline_misses));
  out += hz ? line("%14.1f\n", *hz) : line("%14s\n", "-");
  return out;
}

std::string channel_line(const ChannelSpec& c, const ObserverEndpoint& observer, int number, bool has_frame) {
  std::string out =
      line("%-15s %-9s%-4s ", common::printable(c.name).c_str(), text(c.direction), text(c.dtype));
  out += padded(shape_text(c, observer.description()), 14);
  out += padded(range_text(c) + (c.unit.empty() ? "" : " " + common::printable(c.unit)), 15) + " ";
  if (!has_frame) return out + "-\n";
  const ValueStatistics s = value_statistics(values(observer, number));
  out += line("%.4g … %.4g", s.minimum, s.maximum);
  if (s.non_finite) out += line(", %zu NaN/∞", s.non_finite);
  return out + "\n";
}

// The channel's range, so that successive maps are comparable; the range of the values if the channel's range
// is too wide.
Scale scale_of(const ChannelSpec& c, const std::vector<double>& numbers) {
  if (c.maximum - c.minimum <= 1e6) return {c.minimum, c.maximum};
  const ValueStatistics s = value_statistics(numbers);
  return {s.minimum, s.maximum};
}

// The indices to show: all, or the first and the last ones with -1 marking the gap.
std::vector<std::ptrdiff_t> visible_indices(std::ptrdiff_t count, std::ptrdiff_t max_count) {
  std::vector<std::ptrdiff_t> out;
  for (std::ptrdiff_t i = 0; i < count; ++i)
    if (count <= max_count || i < max_count / 2 || i >= count - max_count / 2)
      out.push_back(i);
    else if (out.back() != -1)
      out.push_back(-1);
  return out;
}

std::string numbers_text(const Plane& plane, const Format& format) {
  constexpr std::ptrdiff_t kWidth = 8;
  const std::ptrdiff_t max_columns = format.all_numbers ? PTRDIFF_MAX : (format.width - 4) / kWidth - 1;
  std::string out;
  for (const std::ptrdiff_t y : visible_indices(plane.rows, format.all_numbers ? PTRDIFF_MAX : 10)) {
    if (y < 0) {
      out += "     …\n";
      continue;
    }
    for (const std::ptrdiff_t x : visible_indices(plane.columns, max_columns))
      out += x < 0 ? "   …" : line("%8.4g", plane.cells[y * plane.columns + x]);
    out += "\n";
  }
  return out;
}

std::string array_text(const ChannelSpec& c, const ObserverEndpoint& observer, int number,
                       const Format& format) {
  const Description& d = observer.description();
  const FrameInfo& frame = observer.info(c.direction);
  if (frame.frame == 0) return "\n" + common::printable(c.name) + ": no frame yet\n";
  const std::vector<double> numbers = values(observer, number);
  std::string out;
  for (std::uint32_t component = 0; component < c.components; ++component) {
    const Plane plane{numbers.data() + component * d.cells(), d.rows, d.columns};
    const Scale scale = scale_of(c, numbers);
    out += "\n" + common::printable(c.name);
    if (c.components > 1) out += line("[%u]", component);
    out += line(", tick %llu", static_cast<unsigned long long>(frame.tick));
    if (format.arrays == ArrayDisplay::kMap) out += "   " + legend(scale, format.colour);
    if (!c.unit.empty()) out += " " + common::printable(c.unit);
    out += "\n";
    out += format.arrays == ArrayDisplay::kMap ? heat_map(plane, scale, format.width, format.colour)
                                               : numbers_text(plane, format);
  }
  return out;
}

}  // namespace

bool is_wanted(const Format& format, const ChannelSpec& c) {
  return format.channels.empty() || std::ranges::count(format.channels, c.name) > 0;
}

std::string text_report(const SurfaceStatus& status, const ObserverEndpoint& observer, const Format& format) {
  const Description& d = *status.description;
  const double period_s = static_cast<double>(d.period_ns) * 1e-9;
  std::string out = common::printable(d.name) + "\n";
  out += line("%u x %u cells, pitch %g%s, %s, period %.6g ms (%.4g Hz), protocol %u.%u\n", d.rows, d.columns,
              d.pitch, d.positions.empty() ? "" : " and positions", text(d.mode), period_s * 1e3,
              1.0 / period_s, d.version_major, d.version_minor);
  out += line("session %016llx, layout %016llx\n\n", static_cast<unsigned long long>(d.session),
              static_cast<unsigned long long>(d.layout_hash));
  out += side_line("surface", d.surface_pid, status.surface, status.sensors, status.sensors_torn);
  out += side_line("controller", status.controller_pid, status.controller, status.actuators,
                   status.actuators_torn);
  if (status.controllers_seen > 1) out += line("%-11s%u attached so far\n", "", status.controllers_seen);
  out += line("\n%-11s%12s%12s%12s%12s%14s\n", "", "skipped", "repeated", "clamped", "late", "frames/s");
  const auto hz = [&](double Rates::*which) {
    return status.rates ? std::optional((*status.rates).*which) : std::nullopt;
  };
  out += counter_line("surface", status.surface_counters, hz(&Rates::sensors_hz));
  out += counter_line("controller", status.controller_counters, hz(&Rates::actuators_hz));
  out += line("\n%-15s %-9s%-4s %-14s%-16s%s\n", "channel", "", "type", "shape", "range", "now");
  for (int i = 0; i < std::ssize(d.channels); ++i)
    out += channel_line(d.channels[i], observer, i, status.frame(d.channels[i].direction).frame != 0);
  if (format.arrays == ArrayDisplay::kNone) return out;
  for (int i = 0; i < std::ssize(d.channels); ++i)
    if (is_wanted(format, d.channels[i])) out += array_text(d.channels[i], observer, i, format);
  return out;
}

std::string text_list(const std::vector<SegmentInfo>& segments) {
  if (segments.empty()) return "no surfaces in /dev/shm\n";
  std::string out =
      line("%-32s%-10s%9s %9s %9s  %s\n", "surface", "is", "pid", "control", "size", "protocol");
  for (const SegmentInfo& s : segments) {
    const char* is = s.ownership == Ownership::kLiving   ? "living"
                     : s.ownership == Ownership::kOrphan ? "orphan"
                                                         : "foreign";
    const auto pid = [](std::uint32_t p) { return p ? std::to_string(p) : std::string("-"); };
    const std::string version =
        s.version_major ? line("%u.%u", s.version_major, s.version_minor) : std::string("-");
    out +=
        line("%-31s %-10s%9s %9s %9s  %s", common::printable(s.name).c_str(), is, pid(s.surface_pid).c_str(),
             pid(s.controller_pid).c_str(), size_text(s.bytes).c_str(), version.c_str());
    out += s.user == ::geteuid() ? "\n" : line("  of another user (%u)\n", s.user);
  }
  return out;
}

}  // namespace shm_protocol::dump
