// Fuzzes all that reads a recording: info, plot, export, replay's frames and replay --verify. Each either
// does its work or refuses the file with a line. Nothing may crash, hang or exhaust memory.
#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "smartsurf/record/Recording.h"
#include "smartsurf/record/plot/Plot.h"
#include "smartsurf/run/replay/RecordedFrames.h"
#include "smartsurf/run/replay/Verify.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/script/LoadOptions.h"
#include "smartsurf/web/GltfFile.h"
#include "smartsurf/web/Page.h"
#include "tests/fuzz/recording/Damage.h"

namespace {

namespace fs = std::filesystem;
using smartsurf::record::Recording;

// One of pins, one of several mechanisms and one of a skin.
constexpr std::array<const char*, 3> kScripts = {
    R"(material { name = 'steel', density = 2 }
surface { rows = 4, columns = 6, actuator = pin {}, sensors = { proximity { range = 8 }, colour {} } }
local n = option('n', 3, 'how many')
for i = 1, n do sphere { radius = 0.6, position = { i, i, 2 + i }, label = 'ball', material = 'steel' } end
box { size = { 1, 1, 1 }, position = { 4, 2, 3 } }
hull { points = { {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1} }, position = { 2, 2, 6 } }
record { sensors = true, actuators = true }
metric('height', function() return 1 end)
metric('raised', function(t) return t end)
success(function() return false end)
every(0.05, function(t) cells:target('height', 1, 1, 1 + t) sphere { radius = 0.3, position = { 3, 3, 8 } } end)
)",
    R"(surface { rows = 3, columns = 4, actuators = { p = pin { range = {0, 3} }, w = wheels { radius = 0.3 }, b = ball {} },
  cells = function(row, column) if row == 2 then return 'w' elseif column == 1 then return 'b' elseif column == 4 then
  return nil end return 'p' end, tilt = {2, 0}, border = { height = 2 } }
cylinder { radius = 0.5, height = 1, position = { 2, 2, 3 } }
record { actuators = true, every = 2 }
on_tick(function() for column = 1, 4 do cells:target('spin_a', 2, column, 8) end end)
)",
    R"(surface { rows = 4, columns = 4, pitch = 2, actuator = pin { top = {0.6, 0.6}, range = {0, 4} },
  skin = { kind = 'kinematic', nodes = {9, 9} } }
sphere { radius = 1, position = { 3, 3, 6 } }
on_tick(function() cells:target('height', 2, 2, 2) end)
)"};

struct Workshop {
  Workshop() {
    std::string name = (fs::temp_directory_path() / "smartsurf-fuzz-XXXXXX").string();
    folder = ::mkdtemp(name.data());
    for (std::size_t i = 0; i < kScripts.size(); ++i) fuzz::record_experiment(kScripts[i], recording(i));
  }
  ~Workshop() {
    std::error_code ignored;
    fs::remove_all(folder, ignored);
  }
  fs::path recording(std::size_t i) const { return folder / (std::to_string(i) + ".h5"); }

  fs::path folder;
};

const Workshop& workshop() {
  static const Workshop one;
  return one;
}

void read_frames(const Recording& recording) {
  smartsurf::run::RecordedFrames frames(recording);
  for (std::size_t frame = 0; frame < recording.frames(); ++frame) frames.frame_input(frame);
  std::vector<double> values(recording.frames());
  for (const smartsurf::view::Signal& signal : frames.run_signals()) frames.read(signal, 0, values);
  for (std::size_t i = 0; i < frames.channels().size(); ++i)
    frames.read({smartsurf::view::Signal::Kind::kCell, frames.channels()[i].name, 0, 1, 1}, 0, values);
}

void verify(const Recording& recording) {
  const std::atomic<bool> stop{false};
  smartsurf::run::verify(recording, 1, {}, workshop().folder / "out", stop, [](double) {});
}

std::vector<std::function<void(const Recording&)>> make_readers() {
  std::vector<std::function<void(const Recording&)>> readers = {
      [](const Recording& r) { smartsurf::record::describe_recording(r); },
      [](const Recording& r) { smartsurf::record::list_datasets(r); },
      [](const Recording& r) { smartsurf::web::write_page(r, workshop().folder / "a.html"); },
      [](const Recording& r) { smartsurf::web::write_gltf(r, workshop().folder / "a.glb"); },
      read_frames,
      verify};
  for (const char* what : {"trajectories", "time-spent", "time-spent:ball", "speed", "speed:0", "height:1,1",
                           "contacts", "proximity:1,1", "colour:1,1", "raised"})
    readers.emplace_back(
        [what](const Recording& r) { smartsurf::record::write_plot(r, what, workshop().folder / "a.svg"); });
  return readers;
}

}  // namespace

#ifdef __SANITIZE_ADDRESS__
// The limits of the programs, which bound the address space.
extern "C" [[gnu::visibility("default")]] const char* __asan_default_options() {
  return "allocator_may_return_null=1:max_allocation_size_mb=2048:hard_rss_limit_mb=4096:"
         "quarantine_size_mb=16:detect_leaks=0";
}
#endif

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto readers = make_readers();
  if (size < 2) return 0;
  const fs::path damaged = workshop().folder / "damaged.h5";
  fuzz::write_damaged(workshop().recording(data[0] % kScripts.size()),
                      fuzz::read_changes({data + 2, size - 2}), damaged);
  try {
    readers[data[1] % readers.size()](Recording::open_here(damaged));
  } catch (const smartsurf::scene::InputError&) {  // one line, status 2
  } catch (const smartsurf::script::Interrupted&) {
  } catch (const std::exception& error) {
    std::fprintf(stderr, "fuzz: not told from a fault of the program: %s\n", error.what());
    std::abort();
  }
  return 0;
}
