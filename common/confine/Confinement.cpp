#include "common/confine/Confinement.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>

#include "common/confine/Landlock.h"
#include "common/confine/SystemCalls.h"
#include "common/error/UserError.h"
#include "common/files/Installation.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SMARTSURF_SANITIZED 1
#else
#define SMARTSURF_SANITIZED 0
#endif

namespace common {
namespace {

std::atomic<bool> confined{false};

// Prefixes of the device files that graphics drivers open beside Mesa's /dev/dri: NVIDIA's own driver,
// Tegra's, Arm's, and that of WSL.
constexpr std::string_view kGraphicsDevices[] = {"nvidia", "nvhost", "nvmap", "nvgpu", "mali", "dxg"};

// Lists of paths in which the loader and OpenGL's dispatch also search for libraries. Relative ones are not
// allowed.
constexpr const char* kLibraryVariables[] = {"LD_LIBRARY_PATH", "LIBGL_DRIVERS_PATH", "GBM_BACKENDS_PATH",
                                             "__EGL_VENDOR_LIBRARY_DIRS", "__EGL_VENDOR_LIBRARY_FILENAMES"};

void add_library_folders(Confinement& confinement) {
  for (const char* const variable : kLibraryVariables) {
    const char* const text = std::getenv(variable);
    std::istringstream list(text != nullptr ? text : "");
    for (std::string path; std::getline(list, path, ':');)
      if (path.starts_with('/')) confinement.read.emplace_back(path);
  }
}

}  // namespace

ConfinementSupport confinement_support() noexcept {
  if (SMARTSURF_SANITIZED) return {};  // sanitizers trace their own process at its end
  return {landlock_version(), has_seccomp()};
}

std::string describe(const ConfinementSupport& support) {
  std::string text = support.seccomp ? "seccomp" : "no seccomp";
  text += support.landlock > 0 ? ", Landlock version " + std::to_string(support.landlock) : ", no Landlock";
  if (support.landlock == 0) return text + ": files are not confined";
  if (support.landlock < 3) return text + ": files that may be read can be truncated (Linux 6.2 prevents it)";
  if (support.landlock < 6)
    return text + ": signals to other processes of the user are not confined (Linux 6.12)";
  return text;
}

ConfinementMode confinement_mode() {
  const char* const text = std::getenv("SMARTSURF_CONFINE");
  const std::string_view mode = text != nullptr ? text : "";
  if (mode.empty()) return ConfinementMode::kAvailable;
  if (mode == "require") return ConfinementMode::kRequired;
  if (mode == "off") return ConfinementMode::kOff;
  throw UserError("SMARTSURF_CONFINE: must be require or off, or not be set");
}

void leave_unconfined(const std::string& what) {
  if (confinement_mode() == ConfinementMode::kRequired)
    throw UserError("SMARTSURF_CONFINE=require: this cannot be confined " + what);
}

void confine(const Confinement& confinement) {
  const ConfinementMode mode = confinement_mode();
  if (mode == ConfinementMode::kOff) return;
  const ConfinementSupport support = confinement_support();
  if (mode == ConfinementMode::kRequired && !support.complete())
    throw UserError("SMARTSURF_CONFINE=require: this system has " + describe(support));
  if (support.landlock > 0) {
    ::setenv("MESA_SHADER_CACHE_DISABLE", "true", 0);  // Mesa prints that it may not write its own
    restrict_files(confinement, support.landlock);
  }
  if (support.seccomp) restrict_calls(confinement.calls);
  if (support.landlock > 0 || support.seccomp) confined.store(true);
}

bool is_confined() noexcept { return confined.load(); }

void add_system_files(Confinement& confinement) {
  for (const char* const file : {"/sys/devices/system/cpu", "/dev/urandom", "/dev/random", "/dev/zero",
                                 "/proc/self/statm", "/proc/loadavg"})
    confinement.read.emplace_back(file);
  for (const char* const file : {"/dev/null", "/dev/full"}) confinement.write.emplace_back(file);
}

void add_picture_files(Confinement& confinement) {
  for (const char* const path : {"/usr",
                                 "/lib",
                                 "/lib64",
                                 "/etc/ld.so.cache",
                                 "/etc/ld.so.preload",
                                 "/etc/fonts",
                                 "/etc/glvnd",
                                 "/etc/egl",
                                 "/etc/drirc",
                                 "/etc/drirc.d",
                                 "/etc/vulkan",
                                 "/var/cache/fontconfig",
                                 "/sys",
                                 "/proc/self",
                                 "/proc/cpuinfo",
                                 "/proc/meminfo",
                                 "/proc/devices",
                                 "/proc/modules",
                                 "/proc/driver/nvidia",
                                 "/etc/nvidia",
                                 "/opt/amdgpu",
                                 "/opt/amdgpu-pro",
                                 "/run/opengl-driver",
                                 "/nix/store"})
    confinement.read.emplace_back(path);
  add_library_folders(confinement);
  for (const char* const variable : {"HOME", "XDG_CACHE_HOME", "XDG_DATA_HOME"})
    if (const char* const home = std::getenv(variable); home != nullptr && *home == '/')
      for (const char* const below : {".fonts", ".fonts.conf", ".config/fontconfig", ".cache/fontconfig",
                                      ".local/share/fonts", "fontconfig", "fonts"})
        confinement.read.push_back(std::filesystem::path(home) / below);
  if (const std::filesystem::path fonts = installed_file("fonts"); !fonts.empty())
    confinement.read.push_back(fonts);
  confinement.write_folders.emplace_back("/dev/dri");
  for (const std::filesystem::path& device : graphics_devices("/dev")) confinement.write.push_back(device);
}

std::vector<std::filesystem::path> graphics_devices(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> devices;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename();
    if (std::ranges::any_of(kGraphicsDevices,
                            [&](std::string_view begin) { return name.starts_with(begin); }))
      devices.push_back(entry.path());
  }
  std::ranges::sort(devices);
  return devices;
}

}  // namespace common
