#include "smartsurf/world/Borders.h"

#include <algorithm>
#include <atomic>

namespace smartsurf::world {

void Borders::make_room(int rows, int members) {
  marked_.resize(static_cast<std::size_t>(rows));
  part_.resize(static_cast<std::size_t>(members));
}

void Borders::clear(Range own_rows) {
  std::fill(marked_.begin() + own_rows.begin, marked_.begin() + own_rows.end, std::uint8_t{0});
}

void Borders::mark(const Octet& o, Range own_rows) {
  for (const std::int32_t* rows : {o.a, o.b})
    for (int lane = 0; lane < kLanes; ++lane)
      if (rows[lane] < own_rows.begin || rows[lane] >= own_rows.end)
        std::atomic_ref(marked_[static_cast<std::size_t>(rows[lane])]).store(1, std::memory_order_relaxed);
}

bool Borders::touches(const Octet& o) const {
  std::uint8_t any = 0;
  for (int lane = 0; lane < kLanes; ++lane)
    any |= marked_[static_cast<std::size_t>(o.a[lane])] | marked_[static_cast<std::size_t>(o.b[lane])];
  return any != 0;
}

void Borders::split(const Schedule& schedule, const Member& member) {
  Part& part = part_[static_cast<std::size_t>(member.index)];
  part.shared.clear();
  part.own.clear();
  for (std::size_t i = 0; i <= schedule.colours().size(); ++i) {
    for (const OctetRun& run : schedule.share(member, i))
      for (int o = run.first; o < run.first + run.count; ++o)
        (touches(schedule.octet(o)) ? part.shared : part.own).add({run.kind, o, 1});
    part.shared.end_colour();
    part.own.end_colour();
  }
}

}  // namespace smartsurf::world
