#include "apron/run/cli/ConfinedProgram.h"

#include <filesystem>
#include <string>

#include "common/confine/Confinement.h"
#include "common/confine/OutputServices.h"
#include "common/files/AtomicFile.h"

namespace apron::run {
namespace {

constexpr int kCameras = 10;  // /dev/video0 to /dev/video9

common::Confinement confinement_of(const Options& options) {
  common::Confinement confinement;
  confinement.calls = common::Confinement::Calls::kPictures;  // compiled kernels are executable memory
  common::add_system_files(confinement);
  for (const std::string& folder : program_folders(options)) confinement.write_folders.emplace_back(folder);
  for (const std::string& camera : options.cameras) confinement.read.emplace_back(camera);
  for (int i = 0; i < kCameras; ++i) confinement.write.emplace_back("/dev/video" + std::to_string(i));
  if (!options.surface.empty())
    confinement.read.emplace_back("/proc");  // whether a surface without a lock lives
  if (options.reconnect) confinement.write_folders.emplace_back("/dev/shm");
  return confinement;
}

}  // namespace

std::vector<std::string> program_folders(const Options& options) {
  std::vector<std::string> folders = options.allowed_folders;
  const std::string own = std::filesystem::path(options.program).parent_path().string();
  folders.push_back(own.empty() ? "." : own);
  return folders;
}

ConfinedProgram::ConfinedProgram(const Options& options, const std::vector<common::NamedOutput>& outputs) {
  if (common::confinement_mode() == common::ConfinementMode::kOff) return;
  if (!options.modules.empty() || options.uses_ui()) {
    common::leave_unconfined(options.uses_ui() ? "with windows and pictures" : "with --module");
    return;
  }
  if (common::is_confined()) return;  // by the session before, after --reconnect
  if (!outputs.empty()) {
    const common::SignalsDeferred deferred;
    for (const common::NamedOutput& output : outputs)
      outputs_.push_back(common::prepare_output(output.flag + " " + output.file.string(), output.file,
                                                common::part_of(output.file)));
    broker_ = std::make_unique<common::Broker>(common::output_services(outputs_),
                                               [this](bool) { common::remove_unnamed(outputs_); });
    common::use_outputs_of(*broker_, outputs_);
  }
  common::Confinement confinement = confinement_of(options);
  common::add_outputs(confinement, outputs_);
  common::confine(confinement);
}

ConfinedProgram::~ConfinedProgram() {
  if (broker_) common::use_prepared_outputs({}, {});
}

}  // namespace apron::run
