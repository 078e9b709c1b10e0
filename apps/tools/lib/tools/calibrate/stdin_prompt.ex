defmodule Tools.Calibrate.StdinPrompt do
  @moduledoc false
  # Asks a person, and reads what is typed while a robot drives. One process reads standard input,
  # line by line, so that no line is lost to an abandoned question.

  @enforce_keys [:reader, :ref]
  defstruct @enforce_keys

  @type t :: %__MODULE__{reader: pid(), ref: reference()}
  @longest 200

  @doc "Begins to listen; lines are sent to the calling process."
  @spec start() :: t()
  def start do
    {owner, ref} = {self(), make_ref()}
    reader = spawn_link(fn -> read(owner, ref) end)
    %__MODULE__{reader: reader, ref: ref}
  end

  @doc "Stops listening."
  @spec stop(t()) :: :ok
  def stop(%__MODULE__{reader: reader}) do
    Process.unlink(reader)
    Process.exit(reader, :kill)
    :ok
  end

  defp read(owner, ref) do
    case IO.gets("") do
      text when is_binary(text) ->
        send(owner, {ref, String.slice(String.trim(text), 0, @longest)})
        read(owner, ref)

      _end_or_error ->
        send(owner, {ref, :eof})
    end
  end

  @doc """
  Asks until the answer is valid: `check` returns `{:ok, value}`, or `{:error, line}`, which is
  shown. Returns `:eof` at the end of the input.
  """
  @spec ask(t(), String.t(), (String.t() -> {:ok, value} | {:error, String.t()})) ::
          {:ok, value} | :eof
        when value: term()
  def ask(%__MODULE__{ref: ref} = talk, question, check) do
    IO.write(question)

    receive do
      {^ref, :eof} ->
        # The next question should get this, too.
        send(self(), {ref, :eof})
        IO.puts("")
        :eof

      {^ref, text} ->
        case check.(text) do
          {:ok, value} ->
            {:ok, value}

          {:error, line} ->
            IO.puts("  " <> line)
            ask(talk, question, check)
        end
    end
  end

  @doc "Asks for one of some words; returns `{:ok, word}`."
  @spec choose(t(), String.t(), [String.t(), ...]) :: {:ok, String.t()} | :eof
  def choose(talk, question, words) do
    ask(talk, question, fn text ->
      word = String.downcase(text)
      if word in words, do: {:ok, word}, else: {:error, allowed(text, words)}
    end)
  end

  defp allowed(text, words) do
    names = Enum.map(words, &if(&1 == "", do: "Enter alone", else: &1))
    "#{Hal.Cli.Parse.either(names)}#{Hal.Options.Suggest.hint(text, words)}"
  end

  @doc "Drops what was typed meanwhile, because it is not an answer to the next question."
  @spec forget(t()) :: :ok
  def forget(%__MODULE__{ref: ref} = talk) do
    receive do
      {^ref, text} when text != :eof -> forget(talk)
    after
      0 -> :ok
    end
  end
end
