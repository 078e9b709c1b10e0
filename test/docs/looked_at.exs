defmodule Docs.LookedAt do
  @moduledoc """
  What can be said of a command without running it: that its program is there, and knows its words and
  options. `nil`, or what is wrong.
  """
  import ExUnit.CaptureIO, only: [capture_io: 1]
  alias Docs.Sandbox

  @ours ~w(Hal Vision Robot Mesh Swarm Missions Sim Console Record Mcap Tools Vm Mix)

  @doc "Of a command's words."
  @spec command([String.t()], Path.t()) :: String.t() | nil
  def command(["bin/demo" | options], _folder), do: demo(options)
  def command(["mix", "demo" | options], _folder), do: demo(options)

  def command(["mix", task, kind | options], folder) when task in ~w(bench calibrate),
    do: options(options, help("mix", [task, kind], folder))

  def command(["mix", task | options], folder) do
    case Mix.Task.get(task) do
      nil -> "there is no mix #{task}"
      _module -> options(options, help("mix", [task], folder))
    end
  end

  def command(["ssh" | words], folder) do
    [_host | rest] = Enum.drop_while(words, &String.starts_with?(&1, "-"))
    rest != [] and command(rest, folder)
  end

  def command(["robot" | words], folder), do: command(["bin/robot" | words], folder)
  def command(["_build/prod/rel/" <> _release | _words], _folder), do: nil

  def command([program], folder) when program in ~w(bin/test bin/setup),
    do: there(program, folder)

  def command(["bin/robot" | words], folder) do
    case words do
      [] ->
        nil

      [option] when option in ~w(--help help) ->
        nil

      [word | _code] ->
        unless help("bin/robot", [], folder) =~ ~r/^ +#{word} /m, do: "there is no #{word}"
    end
  end

  def command(["bin/" <> _ = program | words], folder),
    do: options(words, help(program, [], folder))

  def command(["rel/install" | _words], folder), do: there("rel/install", folder)

  def command(["rel/" <> _ = program | words], folder),
    do: options(words, help(program, [], folder))

  # The system's own.
  def command(_words, _folder), do: nil

  @doc "Of what is typed at the prompt of the demo."
  @spec prompt(String.t()) :: String.t() | nil
  def prompt(text) do
    with {:ok, _command} <- Console.Prompt.parse(text, [:mag1, :mag2, :mag3, :min1]),
         do: nil,
         else: ({:error, line} -> line)
  end

  @doc "Of a command, a module or a function that a sentence names; of anything else nothing is wrong."
  @spec mention(String.t(), Path.t()) :: String.t() | nil
  def mention(text, folder) do
    cond do
      text =~ ~r/^([A-Z_]+=\S+ )*(bin|rel)\/\w+( |$)/ -> mentioned(text, folder)
      text =~ ~r/^([A-Z_]+=\S+ )*(mix|robot) [a-z.]+( |$)/ -> mentioned(text, folder)
      text =~ ~r/^[A-Z]\w*(\.[A-Z]\w*)*(\.[a-z_]+[?!]?(\(.*|\/\d+))?$/s -> function(text, folder)
      true -> nil
    end
  end

  defp mentioned(text, folder) do
    case Docs.Reader.words(text) do
      [program] ->
        there(program, folder)

      ["mix", task] ->
        unless Mix.Task.get(task) || task == "calibrate", do: "there is no mix #{task}"

      words ->
        words |> Enum.reject(&(&1 in ["…", "SOURCE"])) |> command(folder)
    end
  end

  defp function(text, folder) do
    [_all, module | rest] =
      Regex.run(~r/^([A-Z]\w*(?:\.[A-Z]\w*)*)(?:\.([a-z_]+[?!]?)(.*))?$/s, text)

    if hd(String.split(module, ".")) in @ours do
      atom = Module.concat([module])

      case {Code.ensure_loaded(atom), rest} do
        {{:error, _none}, _rest} ->
          unless family?(module) or written?(module, folder), do: "there is no #{module}"

        {_there, []} ->
          nil

        {_there, [name, after_name]} ->
          exported(atom, name, after_name)
      end
    end
  end

  # `Robot.Calibration` may be no module but what many begin with.
  defp family?(module) do
    Enum.any?(
      Application.spec(:console, :modules) ++ loaded(),
      &String.starts_with?(inspect(&1), module <> ".")
    )
  end

  # One that is there where packages of Hex are.
  defp written?(module, folder) do
    folder
    |> Path.join("apps/*/lib/**/*.ex")
    |> Path.wildcard()
    |> Enum.any?(&(File.read!(&1) =~ "defmodule #{module} do"))
  end

  defp loaded,
    do:
      Enum.flat_map(
        [
          :hal,
          :nav,
          :vision,
          :robot,
          :mesh,
          :swarm,
          :missions,
          :record,
          :agents,
          :sim,
          :lab,
          :vm
        ],
        &Application.spec(&1, :modules)
      )

  defp exported(module, name, after_name) do
    arities =
      for {function, arity} <- functions(module), Atom.to_string(function) == name, do: arity

    case Regex.run(~r/^\/(\d+)$/, after_name) do
      [_all, arity] -> unless String.to_integer(arity) in arities, do: "there is no such function"
      nil -> if arities == [], do: "there is no such function"
    end
  end

  # Of a behaviour, what others export.
  defp functions(module) do
    callbacks =
      if function_exported?(module, :behaviour_info, 1),
        do: module.behaviour_info(:callbacks),
        else: []

    module.__info__(:functions) ++ callbacks
  end

  defp demo(options) do
    case Console.Options.parse(options) do
      {:ok, _options} ->
        nil

      {:error, lines} ->
        if Enum.all?(lines, &(&1 =~ "floor.png")), do: nil, else: Enum.join(lines, "; ")
    end
  end

  defp there(program, folder),
    do: unless(File.exists?(Path.join(folder, program)), do: "there is no #{program}")

  defp options(words, help) do
    strange =
      for "-" <> _ = word <- words,
          option = hd(String.split(word, "=")),
          not (option =~ ~r/^-\d/),
          not (help =~ ~r/(^|[\s`|,\[])#{Regex.escape(option)}($|[\s`=|,\].])/m),
          do: option

    if strange != [], do: "its --help does not tell of #{Enum.join(strange, " and ")}"
  end

  # Built-in tasks have no --help of their own.
  defp help("mix", [task] = words, folder) do
    if task in ~w(release deps.get compile run),
      do: Mix.Task.moduledoc(Mix.Task.get(task)),
      else: help_of_task(words, folder)
  end

  defp help("mix", words, folder), do: help_of_task(words, folder)

  defp help(program, words, folder), do: help_of(program, words, folder)

  # Without a VM of its own.
  defp help_of_task([task | words], folder) do
    case Mix.Task.get(task) do
      nil -> help_of("mix", [task | words], folder)
      module -> capture_io(fn -> module.run(words ++ ["--help"]) end)
    end
  end

  # It says the same in every copy: asked once.
  defp help_of(program, words, folder) do
    line = Enum.join([program | words] ++ ["--help"], " ")

    with nil <- :persistent_term.get({__MODULE__, line}, nil) do
      {text, 0} = Sandbox.command(line, folder)
      :persistent_term.put({__MODULE__, line}, text)
      text
    end
  end
end
