// The small files of a place, in a folder or in a bucket: locks, identities, numbers of places.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "engine/core/result.h"

namespace terrace::bake {

std::string HostName();

// kUnavailable: it is not known, because the folder or the bucket cannot be read now.
Result<bool> Exists(const std::filesystem::path& file);
// The whole file. kNotFound: there is none. kUnavailable: it cannot be read. kInvalidArgument: an object of more than
// 1 MiB. Messages name it.
Result<std::string> ReadText(const std::filesystem::path& file);
// The names directly below a folder, without what an NFS client keeps of removed files. Errors: there is no such
// folder, it cannot be read, or it is in a bucket and without objects (archive::NamesInBucket).
Result<std::vector<std::string>> NamesIn(const std::filesystem::path& folder);
// Removes a file if it is there; all errors are ignored.
void Remove(const std::filesystem::path& file);

// Creates a file together with its content, so that no process reads it empty. False: there is one already. An
// object of a bucket is read again a second later: false, too, if another process has replaced it with other content.
// Errors: the message says only why; of an object it names the object and the remedy too. After an error a folder has
// no such file.
Result<bool> CreateFile(const std::string& file, const std::string& content);

}  // namespace terrace::bake
