"""What the documents show runs, or compiles; scripts/check_docs checks their commands and links."""

import os
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'doc').glob('*.md'))]


def snippets(language):
    """(place, text) of each fenced block of a language."""
    found = []
    for page in PAGES:
        text = page.read_text(encoding='utf-8')
        for match in re.finditer(rf'^```{language}\n(.*?)^```$', text, flags=re.M | re.S):
            line = text.count('\n', 0, match.start()) + 1
            found.append(pytest.param(match.group(1), id=f'{page.name}:{line}'))
    assert found
    return found


@pytest.fixture(name='folder')
def fixture_folder(tmp_path, wall_pcd):
    """A robot and a scene under the names that the documents use."""
    shutil.copy(ROOT / 'demo' / 'demo_arm.urdf', tmp_path / 'arm.urdf')
    shutil.copy(wall_pcd, tmp_path / 'scene.pcd')
    return tmp_path


@pytest.mark.parametrize('text', snippets('python'))
def test_python(text, folder):
    result = subprocess.run([sys.executable, '-c', text], cwd=folder, check=False, capture_output=True, text=True, timeout=120)
    assert result.returncode == 0 and result.stdout.strip(), result.stderr


def compiled(source, folder):
    compiler = shutil.which(os.environ.get('CXX', 'c++'))
    if compiler is None:
        pytest.skip('no C++ compiler')
    file = folder / 'snippet.cpp'
    file.write_text(source)
    eigen = subprocess.run(['pkg-config', '--cflags', 'eigen3'], check=False, capture_output=True,
                           text=True).stdout.split() or ['-I/usr/include/eigen3']
    return subprocess.run([compiler, '-std=c++17', '-fsyntax-only', '-Wall', f'-I{ROOT}/include', *eigen,
                           str(file)], check=False, capture_output=True, text=True)


@pytest.mark.parametrize('text', snippets('cpp'))
def test_cpp(text, tmp_path):
    """A program, or statements of one."""
    if 'main(' not in text:
        text = ('#include "ist_proximity/facade/robot.h"\nint main() {\n' + text +
                'return answers.empty() ? 1 : 0;\n}\n')
    result = compiled(text, tmp_path)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize('text', snippets('yaml'))
def test_yaml(text):
    """Every key is one that the commented configuration explains."""
    yaml = pytest.importorskip('yaml')
    known = (ROOT / 'config' / 'proximity.yaml').read_text(encoding='utf-8')

    def check(tree, names_are_free):
        for key, value in tree.items():
            assert names_are_free or re.search(rf'\b{key}:', known), key
            if isinstance(value, dict):
                check(value, key in ('sources', 'links', 'objects'))

    check(yaml.safe_load(text), False)


@pytest.mark.parametrize('text', snippets('xml'))
def test_xml(text):
    """A part of a launch file is well-formed."""
    from xml.etree import ElementTree
    ElementTree.fromstring(f'<launch>{text}</launch>')


def test_the_check_finds_mistakes(tmp_path):
    """scripts/check_docs notices a launch argument, an option and a sentence that are not there."""
    copy = tmp_path / 'copy'
    shutil.copytree(ROOT, copy, ignore=lambda folder, names: {'build', 'devel', '.git', 'meshes'}
                    & set(names) if pathlib.Path(folder) in (ROOT, ROOT / 'demo') else ())
    page = copy / 'doc' / 'start.md'
    page.write_text(page.read_text(encoding='utf-8').replace('cloud:=/camera', 'clout:=/camera', 1)
                    + '\n```bash\nscripts/build --quick\nrostopic echo /proximity/distances\n```\n'
                    '[nowhere](nowhere.md) [no heading](messages.md#nothing) [no address][manual]\n'
                    '## Speeds\n<!-- speeds -->\n<!-- end of speeds -->\n',
                    encoding='utf-8')
    page = copy / 'doc' / 'troubleshooting.md'
    page.write_text(page.read_text(encoding='utf-8').replace('no pose either for', 'no pose for them'),
                    encoding='utf-8')
    result = subprocess.run([sys.executable, copy / 'scripts' / 'check_docs'], check=False,
                            capture_output=True, text=True)
    assert result.returncode != 0
    for mistake in ('has no argument clout', 'has no option --quick', 'no topic /proximity/distances',
                    'nowhere.md: no such file', 'messages.md#nothing: no such heading',
                    'no source says "no pose for them "', 'no command beside the table "speeds"',
                    '[manual] is not defined'):
        assert mistake in result.stderr, result.stderr
    assert len(result.stderr.splitlines()) == 8, result.stderr
