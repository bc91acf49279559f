#include "frames.h"

#include <string.h>

static bool in_memory(const Memory *memory)
{
    const int *integer = memory->integer;
    return integer[AT_image_size] != 0 && (integer[AT_image_base_lo] != 0 || integer[AT_image_base_hi] != 0);
}

FrameSource new_frame(Unit *unit, FrameState *seen, bool by_bus)
{
    const Memory *memory = &unit->memory;
    const int frame_id = memory->integer[AT_frame_id];
    const char *path = memory->string[AT_image_path];
    FrameSource source = path[0] ? FROM_PATH : FROM_NOTHING;
    if (in_memory(memory)) {
        if (memory->boolean[AT_image_buffers_enabled])
            source = FROM_BUFFER;
        else
            tell(unit, &unit->told[BUFFERS_OFF], WARNING,
                MODEL ": the inputs image.* point to a picture in memory, which is not read: the parameter "
                      "image.buffers_enabled is false. Set it to true before the initialisation ends, or give pictures "
                      "by image_path.");
    }
    if (by_bus)
        source = FROM_BUS;
    if (source == FROM_NOTHING) {
        /* A picture in memory is set for one step only, so its absence now does not end the frame. */
        const bool stays = seen->source == FROM_BUFFER
            || (seen->source == FROM_NOTHING && seen->frame_id == frame_id);
        seen->path[0] = '\0';
        if (!stays) {
            seen->source = FROM_NOTHING;
            seen->frame_id = frame_id;
        }
        return FROM_NOTHING;
    }
    /* A changed path or frame number is a new frame; without numbers each picture in memory is one, and so is each step
       with a class by bus, because a bus signal holds its value. */
    const bool by_path = source == FROM_PATH;
    const bool same = by_path ? strcmp(path, seen->path) == 0 : source == seen->source;
    if (same && frame_id == seen->frame_id && (by_path || frame_id != 0))
        return FROM_NOTHING;
    seen->source = source;
    seen->frame_id = frame_id;
    seen->failed = source != FROM_BUS;
    if (by_path)
        memcpy(seen->path, path, STRING_SIZE);
    if (source != FROM_BUS)
        tell(unit, &unit->told[FRAME_PICTURE], WARNING,
            MODEL ": it reads no pictures, as it needs nothing of its host: give the class of the road by road_class and "
                  "road_class_confidence, or take the unit with the networks in it.");
    return source;
}
