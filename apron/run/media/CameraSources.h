// Opens what stands for a camera: a device, a video file or pictures.
#pragma once

#include <memory>
#include <string>

#include "apron/run/media/Camera.h"

namespace apron::run {

// Opens a Video4Linux device such as /dev/video0; a .y4m file; a picture; or a folder, whose pictures follow
// each other by name. Of files, each read() takes the next frame, and after the last the first. Throws
// MediaError.
std::unique_ptr<Camera> open_camera(const std::string& path);

// Remembers the files that the camera would read as inputs of this command (common/files/Inputs.h).
void note_camera(const std::string& path);

}  // namespace apron::run
