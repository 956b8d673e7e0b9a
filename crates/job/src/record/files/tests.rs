use super::*;

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn replaces_whole_and_leaves_no_litter() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a/b.txt");
    write(&path, b"the first and longer one").unwrap();
    let reader = File::open(&path).unwrap();
    write(&path, b"two").unwrap();
    assert_eq!(read(&path).unwrap(), b"two");
    assert_eq!(names(path.parent().unwrap()), ["b.txt"]);
    // A reader of the old file still has it whole: it was replaced, not written over.
    assert_eq!(at_most(reader, 100).unwrap(), b"the first and longer one");
}

#[test]
fn a_file_in_the_way_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let blocker = folder.path().join("blocker");
    write(&blocker, b"").unwrap();
    for error in [
        write(&blocker.join("x.png"), b"").unwrap_err(),
        try_place(&blocker.join("x.png")).unwrap_err(),
    ] {
        assert!(error.to_string().contains("blocker"), "{error}");
    }
    let error = write(folder.path(), b"").unwrap_err().to_string();
    assert!(error.contains("is a folder"), "{error}");
    assert_eq!(names(folder.path()), ["blocker"]);
}

#[test]
fn a_place_is_tried_without_a_trace() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a/b/c.txt");
    try_place(&path).unwrap();
    try_folder(path.parent().unwrap()).unwrap();
    assert!(names(folder.path()).is_empty());
    write(&path, b"x").unwrap();
    try_place(&path).unwrap();
    assert_eq!(read(&path).unwrap(), b"x");
}

#[cfg(unix)]
#[test]
fn permissions_are_kept_and_else_do_not_depend_on_the_umask() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x");
    let mode = || fs::metadata(&path).unwrap().permissions().mode() & 0o7777;
    write(&path, b"x").unwrap();
    assert_eq!(mode(), 0o644);
    fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
    write(&path, b"secret").unwrap();
    assert_eq!((mode(), read(&path).unwrap().as_slice()), (0o600, &b"secret"[..]));
    fs::set_permissions(&path, fs::Permissions::from_mode(0o444)).unwrap();
    let error = write(&path, b"y").unwrap_err().to_string();
    assert!(error.contains("protected against writing"), "{error}");
    assert!(try_place(&path).is_err());
    assert_eq!(read(&path).unwrap(), b"secret");
}

#[cfg(unix)]
#[test]
fn links_stay_and_lead_to_the_new_file() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("elsewhere")).unwrap();
    fs::write(at("elsewhere/old"), b"old").unwrap();
    symlink("elsewhere/old", at("first")).unwrap();
    symlink("first", at("second")).unwrap();
    write(&at("second"), b"new").unwrap();
    assert_eq!(fs::read(at("elsewhere/old")).unwrap(), b"new");
    // A link to nothing makes the file that it names.
    symlink("elsewhere/not-yet", at("third")).unwrap();
    write(&at("third"), b"made").unwrap();
    assert_eq!(fs::read(at("elsewhere/not-yet")).unwrap(), b"made");
    for link in ["first", "second", "third"] {
        assert!(fs::symlink_metadata(at(link)).unwrap().is_symlink(), "{link} was replaced");
    }
    assert_eq!(names(&at("elsewhere")), ["not-yet", "old"]);
    // A link into nowhere, and links in a circle.
    symlink("nowhere/x", at("fourth")).unwrap();
    let error = write(&at("fourth"), b"").unwrap_err().to_string();
    assert!(error.contains("a link into a folder that is not there"), "{error}");
    symlink("sixth", at("fifth")).unwrap();
    symlink("fifth", at("sixth")).unwrap();
    let error = try_place(&at("sixth")).unwrap_err().to_string();
    assert!(error.contains("lead to each other"), "{error}");
}

#[cfg(target_os = "linux")]
#[test]
fn an_open_descriptor_is_appended_to() {
    use std::os::fd::AsRawFd;
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    fs::write(&log, b"keep\n").unwrap();
    let open = OpenOptions::new().write(true).open(&log).unwrap();
    let descriptor = format!("/proc/self/fd/{}", open.as_raw_fd());
    write(Path::new(&descriptor), b"more\n").unwrap();
    let link = folder.path().join("link");
    std::os::unix::fs::symlink(&descriptor, &link).unwrap();
    write(&link, b"and more\n").unwrap();
    assert_eq!(fs::read(&log).unwrap(), b"keep\nmore\nand more\n");
    assert_eq!(names(folder.path()), ["link", "log"]);
}

#[test]
fn the_dead_are_swept_and_the_living_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in [".twofold-aB3dE6.tmp", ".twofold-aB3dE6", ".twofold-my-notes.tmp", "aB3dE6.tmp"] {
        fs::write(at(name), b"half").unwrap();
    }
    let living = at(".twofold-Living.tmp");
    let held = File::create(&living).unwrap();
    held.lock().unwrap();
    write(&at("x"), b"x").unwrap();
    let left =
        [".twofold-Living.tmp", ".twofold-aB3dE6", ".twofold-my-notes.tmp", "aB3dE6.tmp", "x"];
    assert_eq!(names(folder.path()), left);
    drop(held);
    assert_eq!(sweep(folder.path()), 1);
    assert!(!living.exists());
}

/// Writers while others sweep all the time: nothing is lost, nothing stays.
#[test]
fn sweeping_never_takes_a_living_file() {
    let folder = tempfile::tempdir().unwrap();
    let done = std::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while !done.load(std::sync::atomic::Ordering::Relaxed) {
                    sweep(folder.path());
                }
            });
        }
        let writers: Vec<_> = (0..2)
            .map(|w| {
                let folder = folder.path();
                scope.spawn(move || {
                    (0..200).all(|i| write(&folder.join(format!("{w}-{i}")), b"whole").is_ok())
                })
            })
            .collect();
        let whole = writers.into_iter().map(|w| w.join().unwrap()).collect::<Vec<_>>();
        done.store(true, std::sync::atomic::Ordering::Relaxed);
        assert_eq!(whole, [true, true]);
    });
    let names = names(folder.path());
    assert_eq!(names.len(), 400, "{names:?}");
    assert!(names.iter().all(|n| read(&folder.path().join(n)).unwrap() == b"whole"));
}

#[test]
fn what_was_removed_or_cut_meanwhile_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x");
    fs::write(&path, b"1234").unwrap();
    still_there(&[(path.clone(), 4)]).unwrap();
    assert!(
        still_there(&[(path.clone(), 5)]).unwrap_err().to_string().contains("4 bytes instead of 5")
    );
    fs::remove_file(&path).unwrap();
    assert!(still_there(&[(path, 4)]).is_err());
}

#[test]
fn reading_is_bounded_and_wants_text() {
    assert_eq!(at_most(&b"1234"[..], 4).unwrap(), b"1234");
    assert_eq!(at_most(io::repeat(0), 4).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
    let error = read_text_from(io::repeat(b' '), "endless").unwrap_err().to_string();
    assert!(error.contains("endless") && error.contains("16 MiB"), "{error}");
    assert!(read_text_from(&b"\xff"[..], "x").unwrap_err().to_string().contains("not UTF-8"));
}

#[test]
fn a_folder_may_be_called_like_that_of_descriptors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fd/x");
    write(&path, b"the first and longer one").unwrap();
    write(&path, b"two").unwrap();
    assert_eq!(read(&path).unwrap(), b"two");
}

#[test]
fn only_files_with_a_temporary_name_are_swept() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at(".twofold-Folder.tmp")).unwrap();
    let left = [".twofold-Folder.tmp", ".twofold-a-b_c+.tmp", ".twofold-seven77.tmp"];
    for name in [left[1], left[2], ".twofold-abcdef.tmp", ".twofold-UVWXYZ.tmp"] {
        fs::write(at(name), b"half").unwrap();
    }
    assert_eq!(sweep(folder.path()), 2);
    assert_eq!(names(folder.path()), left);
    assert_eq!(sweep(&at("nowhere")), 0);
}

#[cfg(unix)]
#[test]
fn a_growing_file_is_seen_when_it_is_finished() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write(&at("old"), b"what was there").unwrap();
    fs::set_permissions(at("old"), fs::Permissions::from_mode(0o640)).unwrap();
    let mut growing = Growing::begin(&at("old")).unwrap();
    growing.append(b"one ").unwrap();
    growing.append(b"two").unwrap();
    assert_eq!(read(&at("old")).unwrap(), b"what was there");
    growing.finish(None).unwrap();
    assert_eq!(read(&at("old")).unwrap(), b"one two");
    // In another place than it was begun for: with the permissions of what is there.
    let mut growing = Growing::begin(&at("new")).unwrap();
    growing.append(b"three").unwrap();
    assert!(growing.finish(Some(folder.path())).is_err());
    let mut growing = Growing::begin(&at("new")).unwrap();
    growing.append(b"three").unwrap();
    growing.finish(Some(&at("old"))).unwrap();
    assert_eq!(read(&at("old")).unwrap(), b"three");
    assert_eq!(fs::metadata(at("old")).unwrap().permissions().mode() & 0o7777, 0o640);
    // One that is never finished leaves nothing.
    drop(Growing::begin(&at("new")).unwrap());
    assert_eq!(names(folder.path()), ["old"]);
}

#[test]
fn removing_what_is_gone_is_no_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x");
    write(&path, b"x").unwrap();
    remove(&path).unwrap();
    assert!(!path.exists());
    remove(&path).unwrap();
    assert!(remove(folder.path()).unwrap_err().to_string().contains("cannot remove"));
}

#[test]
fn a_place_where_nothing_can_be_written_is_told_beforehand() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    write(&file, b"x").unwrap();
    assert!(try_folder(&file.join("deeper/still")).is_err());
    // A name that no file system takes.
    assert!(try_place(&folder.path().join("n".repeat(300))).is_err());
    assert_eq!(names(folder.path()), ["file"]);
}

#[test]
fn what_is_under_way_is_known_until_it_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let known = || under_way().temporaries.iter().filter(|p| p.starts_with(folder.path())).count();
    let first = Temporary::new_in(folder.path()).unwrap();
    let second = Temporary::new_in(folder.path()).unwrap();
    assert_eq!(known(), 2);
    drop(first);
    assert_eq!(known(), 1);
    second.persist(&folder.path().join("x")).unwrap();
    assert_eq!(known(), 0);
    assert_eq!(names(folder.path()), ["x"]);
}

#[test]
fn who_stands_in_the_way_for_a_moment_is_waited_for() {
    let busy = |e: &io::Error| e.kind() == io::ErrorKind::ResourceBusy;
    let refused_times = |times: usize, kind: io::ErrorKind| {
        let mut tried = 0;
        let done = try_again(
            &mut || {
                tried += 1;
                if tried > times { Ok(()) } else { Err(kind.into()) }
            },
            &busy,
        );
        (done.map_err(|e| e.kind()), tried)
    };
    assert_eq!(refused_times(0, io::ErrorKind::ResourceBusy), (Ok(()), 1));
    assert_eq!(refused_times(3, io::ErrorKind::ResourceBusy), (Ok(()), 4));
    // Not for ever, and not for what will not pass.
    let (never, tried) = refused_times(usize::MAX, io::ErrorKind::ResourceBusy);
    assert_eq!((never, tried), (Err(io::ErrorKind::ResourceBusy), TRIES + 1));
    assert_eq!(refused_times(3, io::ErrorKind::StorageFull), (Err(io::ErrorKind::StorageFull), 1));
}

/// A file that cannot be put in its place leaves nothing behind, and the target stays.
#[test]
fn a_place_that_is_taken_meanwhile_leaves_no_litter() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("x");
    let temporary = Temporary::new_in(folder.path()).unwrap();
    fs::create_dir_all(place.join("deeper")).unwrap();
    assert!(temporary.persist(&place).is_err());
    assert_eq!(names(folder.path()), ["x"]);
    assert!(place.join("deeper").is_dir());
}

/// Windows: a program may keep a file for itself alone.
#[cfg(windows)]
#[test]
fn a_file_that_another_program_keeps_for_itself_is_told_beforehand() {
    use std::os::windows::fs::OpenOptionsExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x");
    write(&path, b"old").unwrap();
    let alone = OpenOptions::new().read(true).share_mode(0).open(&path).unwrap();
    assert!(try_place(&path).unwrap_err().to_string().contains("cannot write"));
    assert!(write(&path, b"new").is_err());
    drop(alone);
    try_place(&path).unwrap();
    write(&path, b"new").unwrap();
    assert_eq!(
        (read(&path).unwrap().as_slice(), names(folder.path())),
        (&b"new"[..], vec!["x".to_owned()])
    );
}

/// Windows: a file that another process reads is replaced when it is closed.
#[cfg(windows)]
#[test]
fn a_file_that_is_read_is_replaced_after_that() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x");
    write(&path, b"old").unwrap();
    let reader = File::open(&path).unwrap();
    let letting_go = thread::spawn(move || {
        thread::sleep(PAUSE * 5);
        drop(reader);
    });
    write(&path, b"new").unwrap();
    letting_go.join().unwrap();
    assert_eq!(
        (read(&path).unwrap().as_slice(), names(folder.path())),
        (&b"new"[..], vec!["x".to_owned()])
    );
}

#[test]
fn a_text_is_read_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x");
    write(&path, "two\nlines, é\n".as_bytes()).unwrap();
    assert_eq!(read_text(&path).unwrap(), "two\nlines, é\n");
    assert!(read_text(&folder.path().join("y")).unwrap_err().to_string().contains("cannot read"));
}
