defmodule Player.Parts do
  @moduledoc """
  Joins a base that a configuration file splits over several drivers. Pure.

  Before Player had one driver `rflex`, it had one for each interface (`rflex_position`,
  `rflex_sonar`, `rflex_ir`, `rflex_bumper`, `rflex_power`), each in a section of its own, with
  the same options. They are one base with one serial line, so they become one section, in the
  place of the first of them. The oldest files write numbers in quotes.
  """
  alias Player.{Sections, Tokens}

  @parts ~w(rflex_position rflex_sonar rflex_ir rflex_bumper rflex_power rflex_dio rflex_aio)
  @texts ~w(name driver provides requires rflex_serial_port rflex_bumper_style)

  @doc "The names of those drivers of Player that are parts of one base."
  @spec names() :: [String.t()]
  def names, do: @parts

  @doc """
  Joins the sections that are parts of one base.

      iex> {:ok, file} = Player.Sections.parse(~s|position:0 ( driver "rflex_position" mm_width "540.0" )
      ...>   sonar:0 ( driver "rflex_sonar" num_sonars_in_bank "6 6" )|)
      iex> Player.Parts.join(file.sections)
      [
        %{
          type: "position:0",
          line: 1,
          sections: [],
          options: [
            {"driver", 1, "rflex_position"},
            {"mm_width", 1, 540.0},
            {"driver", 2, "rflex_sonar"},
            {"num_sonars_in_bank", 2, {:tuple, [6, 6]}}
          ]
        }
      ]
  """
  @spec join([Sections.section()]) :: [Sections.section()]
  def join(sections) do
    case Enum.split_with(sections, &part?/1) do
      {[], others} ->
        others

      {parts, others} ->
        options = for part <- parts, option <- part.options, do: unquoted(option)
        base = %{hd(parts) | options: options, sections: Enum.flat_map(parts, & &1.sections)}
        Enum.sort_by([base | others], & &1.line)
    end
  end

  defp part?(section) do
    Enum.any?(section.options, fn {name, _line, value} ->
      name in ["name", "driver"] and value in @parts
    end)
  end

  defp unquoted({name, line, text}) when is_binary(text) and name not in @texts do
    with {:ok, tokens} <- Tokens.cut(text),
         {numbers, [{:end, _line, nil}]} when numbers != [] <-
           Enum.split_while(tokens, &match?({:number, _line, _value}, &1)) do
      {name, line, value(for {:number, _line, value} <- numbers, do: value)}
    else
      _no_numbers -> {name, line, text}
    end
  end

  defp unquoted(option), do: option

  defp value([one]), do: one
  defp value(several), do: {:tuple, several}
end
