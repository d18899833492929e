#include "tests/peers/Mujoco.h"

#include <cstring>
#include <stdexcept>

namespace peers {

Mujoco::Mujoco(const std::string& mjcf) {
  const auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
#if mjVERSION_HEADER >= 300
  mj_addBufferVFS(files.get(), "scene.xml", mjcf.data(), static_cast<int>(mjcf.size()));
#else
  mj_makeEmptyFileVFS(files.get(), "scene.xml", static_cast<int>(mjcf.size()));
  std::memcpy(files->filedata[0], mjcf.data(), mjcf.size());
#endif
  char message[1000] = "";
  model_.reset(mj_loadXML("scene.xml", files.get(), message, sizeof(message)));
  mj_deleteVFS(files.get());
  if (!model_) throw std::runtime_error(std::string("MuJoCo: ") + message);
  data_.reset(mj_makeData(model_.get()));
}

}  // namespace peers
